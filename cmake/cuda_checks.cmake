# SPDX-License-Identifier: Apache-2.0
# Compiling kernels needs nvcc alone, so their resources are checked wherever nvcc is found. With LANGGS_ENABLE_CUDA also
# tests/cuda/*_test.cu, which need a GPU, or a launcher that executes CUDA programs without one.
set(LANGGS_CUDA_LAUNCHER "" CACHE STRING "Command that runs CUDA test programs; empty: run them directly")

find_program(LANGGS_NVCC nvcc HINTS ENV CUDA_PATH ENV CUDA_HOME PATHS /usr/local/cuda PATH_SUFFIXES bin)
get_target_property(eigen_include Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
add_test(NAME cuda.kernels
         COMMAND bash "${CMAKE_CURRENT_SOURCE_DIR}/checks/cuda_kernels.sh" "${LANGGS_NVCC}" "${CMAKE_CXX_COMPILER}"
                 "${PROJECT_BINARY_DIR}/cuda" "${eigen_include}"
         WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}")
set_tests_properties(cuda.kernels PROPERTIES LABELS cuda TIMEOUT 900 SKIP_RETURN_CODE 77 COST 100)  # long: goes first

add_test(NAME cuda.headers
         COMMAND bash "${CMAKE_CURRENT_SOURCE_DIR}/checks/cuda_headers.sh" "${LANGGS_NVCC}" "${PROJECT_BINARY_DIR}/cuda"
                 "${eigen_include}"
         WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}")
set_tests_properties(cuda.headers PROPERTIES LABELS cuda TIMEOUT 600 SKIP_RETURN_CODE 77 COST 50)

if(LANGGS_ENABLE_CUDA)
  file(GLOB cuda_tests CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/cuda/*_test.cu")
  file(GLOB cuda_host_sources CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/cuda/*.cpp")
endif()
if(LANGGS_ENABLE_CUDA AND cuda_tests)
  if(CMAKE_UNITY_BUILD)  # CMake 3.25 makes none of CUDA sources
    list(TRANSFORM cuda_tests REPLACE "(.+)" "#include \"\\1\"")
    list(JOIN cuda_tests "\n" all_tests)
    set(cuda_tests "${CMAKE_CURRENT_BINARY_DIR}/cuda/all_tests.cu")
    file(CONFIGURE OUTPUT "${cuda_tests}" CONTENT "@all_tests@\n" @ONLY)
  endif()
  add_executable(test_cuda ${cuda_tests} ${cuda_host_sources} main.cpp)
  target_include_directories(test_cuda PRIVATE "${CMAKE_CURRENT_SOURCE_DIR}")
  target_link_libraries(test_cuda PRIVATE doctest::doctest langgs::cuda)
  set_target_properties(test_cuda PROPERTIES CUDA_STANDARD 17 CUDA_RUNTIME_LIBRARY Shared
                                             CROSSCOMPILING_EMULATOR "${LANGGS_CUDA_LAUNCHER}")
  target_compile_options(test_cuda PRIVATE "$<$<COMPILE_LANGUAGE:CUDA>:-lineinfo;--no-compress>")
  # nvcc on the PATH may be a wrapper: tell the launcher where the toolkit is that these programs were built with.
  find_path(LANGGS_CUDA_INCLUDE cuda_runtime_api.h HINTS ${CMAKE_CUDA_TOOLKIT_INCLUDE_DIRECTORIES} REQUIRED)
  get_filename_component(cuda_root "${LANGGS_CUDA_INCLUDE}" DIRECTORY)
  # Results may depend on no order of threads. A GPU has its own; ptxrun takes one, and looks for races, reads of what
  # nobody wrote, leaks, and work that the program does not wait for.
  set(orders fwd)
  set(alone RESOURCE_LOCK gpu)
  if(LANGGS_CUDA_LAUNCHER)
    list(APPEND orders rev rand:1 rand:2 rand:3)
    set(alone "")
    # With the instructions that came with sm_80; langgs_slam is built without them.
    set_target_properties(test_cuda PROPERTIES CUDA_ARCHITECTURES 80-virtual)
    set(launcher_arch "PTXRUN_CC=80;")
  endif()
  set(launcher_checks "CUDA_PATH=${cuda_root};PTXRUN_STRICT=1;PTXRUN_LEAKCHECK=1;PTXRUN_STREAMS=lazy")
  foreach(order IN LISTS orders)
    string(REPLACE ":" "" name "cuda.run.${order}")
    add_test(NAME ${name} COMMAND test_cuda "--test-case-exclude=A run on CUDA*")
    set_tests_properties(${name} PROPERTIES LABELS cuda TIMEOUT 1200 ${alone} ENVIRONMENT
      "${launcher_arch}${launcher_checks};PTXRUN_ORDER=${order};PTXRUN_RACECHECK=1;PTXRUN_INITCHECK=1;PTXRUN_CHECK_SHUFFLE=1")
  endforeach()
  # Whole runs take a minute on a CPU: once, with kernels that have been checked above.
  add_test(NAME cuda.slam COMMAND test_cuda "--test-case=A run on CUDA*")
  set_tests_properties(cuda.slam PROPERTIES LABELS cuda TIMEOUT 1200 ${alone}
                                            ENVIRONMENT "${launcher_arch}${launcher_checks}")
  if(TARGET examples_cuda)
    add_test(NAME cuda.program COMMAND sh "${CMAKE_CURRENT_SOURCE_DIR}/checks/cuda_program.sh" $<TARGET_FILE:langgs_slam>
                                          "${PROJECT_BINARY_DIR}/program/cuda" ${LANGGS_CUDA_LAUNCHER})
    set_tests_properties(cuda.program PROPERTIES LABELS cuda TIMEOUT 1200 ${alone} ENVIRONMENT "${launcher_checks}")
  endif()
endif()
