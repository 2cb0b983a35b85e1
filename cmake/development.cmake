# SPDX-License-Identifier: Apache-2.0
# langgs_development: what our own tests, examples and benchmarks are compiled with.
include("${CMAKE_CURRENT_LIST_DIR}/warnings.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/arch.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/sanitizers.cmake")

add_library(langgs_development INTERFACE)
target_link_libraries(langgs_development INTERFACE langgs::langgs langgs_warnings langgs_arch langgs_sanitizers)
