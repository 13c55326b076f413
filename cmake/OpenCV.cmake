# Debian ships OpenCVConfig.cmake only with libopencv-dev, which brings all of OpenCV and a gigabyte of
# what it needs. The five modules used here have packages of their own.
find_path(WEFT_OPENCV_INCLUDE opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
foreach(module core imgproc imgcodecs videoio calib3d)
  find_library(WEFT_OPENCV_${module} opencv_${module} REQUIRED)
  add_library(opencv_${module} SHARED IMPORTED)
  set_target_properties(opencv_${module} PROPERTIES
    IMPORTED_LOCATION ${WEFT_OPENCV_${module}}
    INTERFACE_INCLUDE_DIRECTORIES ${WEFT_OPENCV_INCLUDE})
endforeach()
