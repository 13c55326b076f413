# Flags shared by every target of the project.
add_library(weft_flags INTERFACE)
target_compile_options(weft_flags INTERFACE -Wall -Wextra -Wconversion)
# GCC 12 takes the undefined halves of AVX-512 intrinsics for uninitialized variables.
target_compile_options(weft_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>
                       $<$<CXX_COMPILER_ID:GNU>:-Wno-uninitialized>)
if(WEFT_NATIVE)
  target_compile_options(weft_flags INTERFACE -march=native)
endif()
# A result must not depend on how the compiler fuses operations from one build to the next.
target_compile_options(weft_flags INTERFACE -ffp-contract=off)
if(WEFT_SANITIZE)
  target_compile_options(weft_flags INTERFACE -fsanitize=${WEFT_SANITIZE} -fno-omit-frame-pointer
                         -fno-sanitize-recover=all)
  target_link_options(weft_flags INTERFACE -fsanitize=${WEFT_SANITIZE})
endif()

# One module = one static library `weft_<name>` from src/weft/<name>/*.cpp. Its public include
# directory is a folder of links to the modules that it may include, so that a header of a module
# above is not found.
function(weft_module name)
  cmake_parse_arguments(ARG "" "" "DEPENDS;LIBRARIES" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/weft/${name}/*.cpp)
  set(include_dir ${PROJECT_BINARY_DIR}/include/${name})
  file(MAKE_DIRECTORY ${include_dir}/weft)
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/src/weft/${name} ${include_dir}/weft/${name} SYMBOLIC)
  if(sources)
    add_library(weft_${name} STATIC ${sources})
    target_include_directories(weft_${name} PUBLIC ${include_dir})
    target_link_libraries(weft_${name} PUBLIC ${ARG_LIBRARIES} PRIVATE weft_flags)
    set(kind PUBLIC)
  else()
    add_library(weft_${name} INTERFACE)
    target_include_directories(weft_${name} INTERFACE ${include_dir})
    target_link_libraries(weft_${name} INTERFACE ${ARG_LIBRARIES})
    set(kind INTERFACE)
  endif()
  foreach(dependency ${ARG_DEPENDS})
    target_link_libraries(weft_${name} ${kind} weft_${dependency})
  endforeach()
endfunction()
