# SPDX-License-Identifier: Apache-2.0
# What a user's compiler must and must not accept. The targets are built by their CTests, not by `all`.

# langgs_add_build_test(<test> <target>): a CTest that builds a target of this build tree.
function(langgs_add_build_test name target)
  add_test(NAME ${name} COMMAND "${CMAKE_COMMAND}" --build "${PROJECT_BINARY_DIR}" --config $<CONFIG> --target ${target})
  set_tests_properties(${name} PROPERTIES LABELS check TIMEOUT 900 RESOURCE_LOCK build_tree COST 50)
endfunction()

# Every public header compiles alone, and twice. Headers under cuda/ need nvcc: checks/cuda_headers.sh.
set(headers ${langgs_headers})
list(FILTER headers EXCLUDE REGEX "/langgs/cuda/|\\.cuh$")
set(alone_sources "")
set(include_all "")
set(outside_includes "")
foreach(header IN LISTS headers)
  file(RELATIVE_PATH name "${PROJECT_SOURCE_DIR}/include" "${header}")
  string(REPLACE "/" "." file_name "${name}")
  set(source "${CMAKE_CURRENT_BINARY_DIR}/headers/${file_name}.cpp")
  file(CONFIGURE OUTPUT "${source}" CONTENT "#include \"@name@\"\n#include \"@name@\"\n" @ONLY)
  list(APPEND alone_sources "${source}")
  string(APPEND include_all "#include \"${name}\"\n")
  file(STRINGS "${header}" lines REGEX "^#include <")
  list(APPEND outside_includes ${lines})
endforeach()
add_library(headers_alone OBJECT EXCLUDE_FROM_ALL ${alone_sources})
target_link_libraries(headers_alone PRIVATE langgs_development)
target_compile_options(headers_alone PRIVATE -O0)
set_target_properties(headers_alone PROPERTIES UNITY_BUILD OFF)  # alone, whatever the tests do
langgs_add_build_test(headers.alone headers_alone)
set_property(TEST headers.alone APPEND PROPERTY LABELS headers)

# Names that <complex.h>, <termios.h>, X11, logging and test libraries define as macros. What we
# include from elsewhere comes first: only our own spelling is on trial.
list(REMOVE_DUPLICATES outside_includes)
list(FILTER outside_includes EXCLUDE REGEX "cuda|cub/|thrust/|experimental")
list(JOIN outside_includes "\n" outside_includes)
set(poison "")
set(poison_words I B0 None Bool Status CHECK REQUIRE LOG INFO PI EPSILON DEBUG STRICT IN OUT OPTIONAL)
foreach(word IN LISTS poison_words)
  string(APPEND poison "#undef ${word}\n#define ${word} a macro must not reach langgs\n")
endforeach()
file(CONFIGURE OUTPUT "${CMAKE_CURRENT_BINARY_DIR}/headers/poisoned.cpp"
     CONTENT "@outside_includes@\n@poison@\n@include_all@" @ONLY)
add_library(headers_poisoned OBJECT EXCLUDE_FROM_ALL "${CMAKE_CURRENT_BINARY_DIR}/headers/poisoned.cpp")
target_link_libraries(headers_poisoned PRIVATE langgs_development)
target_compile_options(headers_poisoned PRIVATE -O0)
langgs_add_build_test(headers.poisoned headers_poisoned)

# tests/compile_fail/*.cpp must be refused with the message that the file's EXPECT comment names.
file(GLOB sources CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/compile_fail/*.cpp")
foreach(source IN LISTS sources)
  get_filename_component(name "${source}" NAME_WE)
  file(STRINGS "${source}" expect REGEX "^// EXPECT: ")
  string(REGEX REPLACE "^// EXPECT: " "" expect "${expect}")
  if(NOT expect)
    message(FATAL_ERROR "${source} has no line '// EXPECT: <regex of the compiler's message>'")
  endif()
  add_library(compile_fail_${name} OBJECT EXCLUDE_FROM_ALL "${source}")
  target_link_libraries(compile_fail_${name} PRIVATE langgs_development)
  target_compile_options(compile_fail_${name} PRIVATE -O0)
  langgs_add_build_test(compile_fail.${name} compile_fail_${name})
  set_tests_properties(compile_fail.${name} PROPERTIES PASS_REGULAR_EXPRESSION "(error|assert)[^\n]*${expect}")
endforeach()
