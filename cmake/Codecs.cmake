# What weft/vision/codecs.h loads when it is first asked for: in the top folder of a build, where it is
# installed beside the modules. A static library cannot say so itself to those that link it.
weft_find_opencv(imgcodecs videoio)
add_library(weft_codecs MODULE src/weft/vision/codecs/opencv_codecs.cpp)
target_include_directories(weft_codecs PRIVATE ${PROJECT_BINARY_DIR}/include/vision)
target_link_libraries(weft_codecs PRIVATE opencv_core opencv_imgcodecs opencv_videoio weft_flags)
set_target_properties(weft_codecs PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}
                      BUILD_WITH_INSTALL_RPATH ON INSTALL_RPATH_USE_LINK_PATH ON)
add_dependencies(weft_vision weft_codecs)
target_link_options(weft_vision INTERFACE
                    $<INSTALL_INTERFACE:LINKER:-rpath,$<INSTALL_PREFIX>/${CMAKE_INSTALL_LIBDIR}>)
