# SPDX-License-Identifier: BSD-3-Clause

# The flags of all our targets.
function(adasfm_target_options target)
  target_compile_features(${target} PUBLIC cxx_std_17)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  target_compile_options(${target} PRIVATE -Wall -Wextra)
  if(ADASFM_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(ADASFM_BUILD_FUZZERS)
    # The fuzzer follows what the layers execute.
    target_compile_options(${target} PUBLIC -fsanitize=fuzzer-no-link)
  endif()
  if(ADASFM_SANITIZE STREQUAL thread)
    target_compile_options(${target} PUBLIC -fsanitize=thread)
    target_link_options(${target} PUBLIC -fsanitize=thread)
  elseif(ADASFM_SANITIZE)
    target_compile_options(${target} PUBLIC -fsanitize=address,undefined
                           -fno-sanitize-recover=undefined
                           -fno-omit-frame-pointer)
    if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
      # A check of each pointer doubles the time of Eigen's code, and
      # AddressSanitizer finds bad addresses too. Clang's build of the fuzzers
      # keeps these checks for the parsers. Calls in place of inlined checks
      # compile in a fifth less time.
      target_compile_options(${target} PUBLIC
        -fno-sanitize=null,alignment,object-size,vptr
        --param=asan-instrumentation-with-call-threshold=0)
    endif()
    # Eigen hides an offset before each block under AddressSanitizer, where
    # COLMAP's library, which is not instrumented, expects none.
    target_compile_definitions(${target} PUBLIC EIGEN_MALLOC_ALREADY_ALIGNED=1)
    target_link_options(${target} PUBLIC -fsanitize=address,undefined)
  endif()
endfunction()

# With ADASFM_UNITY the sources of a room (a folder) are compiled as one file, in
# less than half of the time: names in their anonymous namespaces must differ.
function(adasfm_unite_rooms target)
  if(NOT ADASFM_UNITY)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON
                        UNITY_BUILD_MODE GROUP)
  get_target_property(sources ${target} SOURCES)
  list(FILTER sources INCLUDE REGEX "\\.cc$")
  foreach(source ${sources})
    get_filename_component(room ${source} DIRECTORY)
    file(RELATIVE_PATH room ${PROJECT_SOURCE_DIR} ${room})
    string(MAKE_C_IDENTIFIER ${room} room)
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${room})
  endforeach()
endfunction()

# adasfm_layer(name libraries...): the library adasfm_<name> of all sources in
# the folder of that name.
function(adasfm_layer name)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS
       ${PROJECT_SOURCE_DIR}/${name}/*.cc ${PROJECT_SOURCE_DIR}/${name}/*.h)
  add_library(adasfm_${name} STATIC ${sources})
  set_target_properties(adasfm_${name} PROPERTIES LINKER_LANGUAGE CXX)
  target_include_directories(adasfm_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include/adasfm>)
  target_link_libraries(adasfm_${name} PUBLIC ${ARGN})
  adasfm_unite_rooms(adasfm_${name})
  adasfm_target_options(adasfm_${name})
endfunction()
