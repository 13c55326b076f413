# `cmake --install build --prefix WHERE`: the program, and the modules for find_package(weft), each
# as weft::NAME with what it needs (examples/library).
include(CMakePackageConfigHelpers)
set(weft_package ${CMAKE_INSTALL_LIBDIR}/cmake/weft)

# What was found outside the system's folders is found there again, and the codecs beside the program
# in a build as beside the libraries where both are installed: installing need not change that.
file(RELATIVE_PATH weft_libraries /${CMAKE_INSTALL_BINDIR} /${CMAKE_INSTALL_LIBDIR})
set_target_properties(weft PROPERTIES BUILD_WITH_INSTALL_RPATH ON INSTALL_RPATH_USE_LINK_PATH ON
                      INSTALL_RPATH "$ORIGIN;$ORIGIN/${weft_libraries}")
install(TARGETS weft RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS weft_codecs LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
foreach(module ${WEFT_MODULES})
  set_target_properties(weft_${module} PROPERTIES EXPORT_NAME ${module})
  install(TARGETS weft_${module} EXPORT weft ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
endforeach()
install(DIRECTORY src/weft DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(EXPORT weft NAMESPACE weft:: FILE weftTargets.cmake DESTINATION ${weft_package})

# Numbers of a version below 1 that differ in the second may differ in the interface.
write_basic_package_version_file(weftConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES cmake/weftConfig.cmake cmake/OpenCV.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/weftConfigVersion.cmake
        DESTINATION ${weft_package})
