# SPDX-License-Identifier: Apache-2.0
# langgs::cuda: what a program whose .cu files include langgs links to. It exists where the CUDA language is enabled:
# find_package(langgs) after project(... LANGUAGES CXX CUDA).
if(CMAKE_CUDA_COMPILER AND NOT TARGET langgs::cuda)
  add_library(langgs::cuda INTERFACE IMPORTED GLOBAL)
  target_link_libraries(langgs::cuda INTERFACE langgs::langgs)
  # CMake 3.25 knows no C++20 flag for nvcc 13. constexpr functions of the standard library run in kernels, too.
  target_compile_options(langgs::cuda INTERFACE "$<$<COMPILE_LANGUAGE:CUDA>:-std=c++20;--expt-relaxed-constexpr>")
  # Eigen is host code: then nvcc sees the same Eigen as the host's compiler.
  target_compile_definitions(langgs::cuda INTERFACE EIGEN_NO_CUDA)
endif()
