# Debian ships OpenCVConfig.cmake only with libopencv-dev, which brings all of OpenCV and a gigabyte of
# what it needs. The modules used here have packages of their own.
find_path(WEFT_OPENCV_INCLUDE opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
function(weft_find_opencv)
  foreach(module ${ARGN})
    find_library(WEFT_OPENCV_${module} opencv_${module} REQUIRED)
    add_library(opencv_${module} SHARED IMPORTED)
    set_target_properties(opencv_${module} PROPERTIES
      IMPORTED_LOCATION ${WEFT_OPENCV_${module}}
      INTERFACE_INCLUDE_DIRECTORIES ${WEFT_OPENCV_INCLUDE})
  endforeach()
endfunction()

# What those that link weft need; what is loaded when it is asked for is cmake/Codecs.cmake's.
weft_find_opencv(core imgproc calib3d)
