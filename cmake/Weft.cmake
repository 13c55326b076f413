# Flags shared by every target of the project.
add_library(weft_flags INTERFACE)
target_compile_options(weft_flags INTERFACE -Wall -Wextra -Wconversion)
# GCC 12 takes the undefined halves of AVX-512 intrinsics for uninitialized variables and what they
# read for out of bounds, and with precompiled headers the short strings of the standard library, too.
# AddressSanitizer finds what these would.
target_compile_options(weft_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>
                       $<$<CXX_COMPILER_ID:GNU>:-Wno-uninitialized>
                       $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds>
                       $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overread>
                       $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
# GCC tidies up its memory again and again from 128 MiB on: a tenth of the time of joined sources. From
# 1 GiB on the largest takes 2.2 GB instead of 1.8.
target_compile_options(weft_flags INTERFACE
                       $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1048576>)
# Clang counts changes of sign among conversions (GCC does not, in C++), and warns of vectors in the
# arguments of functions that another program could call.
target_compile_options(weft_flags INTERFACE $<$<CXX_COMPILER_ID:Clang>:-Wno-sign-conversion>
                       $<$<CXX_COMPILER_ID:Clang>:-Wno-psabi>)
if(WEFT_NATIVE)
  target_compile_options(weft_flags INTERFACE -march=native)
endif()
# A result must not depend on how the compiler fuses operations from one build to the next.
target_compile_options(weft_flags INTERFACE -ffp-contract=off)
if(WEFT_SANITIZE)
  target_compile_options(weft_flags INTERFACE -fsanitize=${WEFT_SANITIZE} -fno-omit-frame-pointer
                         -fno-sanitize-recover=all)
  if(WEFT_SANITIZE MATCHES undefined)
    # A check at every access through a pointer, 40 % of the build: AddressSanitizer stops at null and
    # beyond an object as well, and Eigen asserts its own alignment (and takes blocks of no columns of
    # matrices without memory, which is arithmetic on null).
    target_compile_options(weft_flags INTERFACE
                           -fno-sanitize=null,object-size,alignment,vptr,pointer-overflow)
  endif()
  if(WEFT_SANITIZE MATCHES address)
    # A frame on the heap for each call, 13 and 22 % of two long tests: both compilers warn of what
    # returns the address of a local, and uses after a scope within a function are still found.
    target_compile_options(weft_flags INTERFACE
      $<$<CXX_COMPILER_ID:Clang>:-fsanitize-address-use-after-return=never>)
  endif()
  target_link_options(weft_flags INTERFACE -fsanitize=${WEFT_SANITIZE})
endif()

# For what only calls the libraries (the program, tests): what is timed and tuned is in these, and a
# third of the time of a compiler goes into optimizing what runs once.
function(weft_build_quickly target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
  if(WEFT_SANITIZE)
    # A quarter of the time of what is compiled with sanitizers.
    target_compile_options(${target} PRIVATE
      $<$<CXX_COMPILER_ID:Clang>:SHELL:-mllvm -inline-threshold=10>)
  endif()
endfunction()

# What nearly every source includes is parsed once a kind of target instead of once a source: a third
# of the time of a build. Sources include what they use all the same: scripts/check says how that is
# told.
set(weft_common_headers <Eigen/Dense> <Eigen/SparseCore> <algorithm> <array> <chrono> <cmath>
    <filesystem> <fmt/format.h> <fstream> <functional> <limits> <map> <memory> <mutex> <optional>
    <string> <string_view> <vector>)

# The precompiled header of `owner`, with further headers of its own, is that of all its kind.
function(weft_precompile target owner)
  if(target STREQUAL owner)
    target_precompile_headers(${target} PRIVATE ${weft_common_headers} ${ARGN})
  else()
    target_precompile_headers(${target} REUSE_FROM ${owner})
  endif()
endfunction()

# Up to sixteen sources as one: what each would instantiate of Eigen, CLI11 and nlohmann-json is
# instantiated once, and headers are read once. Half the time of a whole build, but many times that
# of one source: -DWEFT_JOIN_SOURCES=OFF (preset `develop`) for who edits. Sources of one target
# have names that differ for this, in unnamed namespaces, too.
function(weft_join_sources target)
  if(WEFT_JOIN_SOURCES)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 16)
    # GCC takes each of them for a header, whose unnamed namespaces would differ from source to source.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
endfunction()

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
    target_link_libraries(weft_${name} PUBLIC ${ARG_LIBRARIES}
                          PRIVATE $<BUILD_INTERFACE:weft_flags>)
    weft_precompile(weft_${name} weft_base)
    weft_join_sources(weft_${name})
    set(kind PUBLIC)
  else()
    add_library(weft_${name} INTERFACE)
    target_link_libraries(weft_${name} INTERFACE ${ARG_LIBRARIES})
    set(kind INTERFACE)
  endif()
  target_include_directories(weft_${name} ${kind} $<BUILD_INTERFACE:${include_dir}>
                             $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(weft_${name} ${kind} cxx_std_20)
  if(WEFT_NATIVE)
    # How Eigen aligns what is passed depends on the instruction set.
    target_compile_options(weft_${name} ${kind} $<INSTALL_INTERFACE:-march=native>)
  endif()
  set(WEFT_MODULES ${WEFT_MODULES} ${name} PARENT_SCOPE)
  foreach(dependency ${ARG_DEPENDS})
    target_link_libraries(weft_${name} ${kind} weft_${dependency})
  endforeach()
endfunction()
