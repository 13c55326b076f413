# Installs the build to an empty folder, builds examples/library against that, and runs it:
#   cmake -DSOURCE=... -DBUILD=... -DWORK=... -DCOMPILER=... -P install_test.cmake
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}: ${status}\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
run(${WORK}/prefix/bin/weft --version)
run(${CMAKE_COMMAND} -S ${SOURCE}/examples/library -B ${WORK}/build -G Ninja
    -DCMAKE_PREFIX_PATH=${WORK}/prefix -DCMAKE_CXX_COMPILER=${COMPILER})
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${WORK}/build/response ${SOURCE}/data/captures/cotton_waving_A)
# A number that is not zero beside a parameter that a hanging cloth answers to.
if(NOT output MATCHES "bend_stiffness +[0-9.]*[1-9][0-9]* mm")
  message(FATAL_ERROR "response printed\n${output}")
endif()
file(REMOVE_RECURSE ${WORK})
