# SPDX-License-Identifier: Apache-2.0
set(LANGGS_SANITIZE "" CACHE STRING "Sanitizers of our own programs: empty, address (with undefined) or thread")
set_property(CACHE LANGGS_SANITIZE PROPERTY STRINGS "" address thread)

add_library(langgs_sanitizers INTERFACE)
if(LANGGS_SANITIZE STREQUAL "address")
  # Thrust 1.17 binds a reference to a null tag object in its dispatch (thrust/detail/reference.h).
  set(flags -fsanitize=address,undefined -fno-sanitize=null -fno-sanitize-recover=undefined)
elseif(LANGGS_SANITIZE STREQUAL "thread")
  set(flags -fsanitize=thread)
elseif(LANGGS_SANITIZE)
  message(FATAL_ERROR "LANGGS_SANITIZE is '${LANGGS_SANITIZE}'; use address, thread or leave it empty")
endif()
if(flags)
  target_compile_options(langgs_sanitizers INTERFACE ${flags} -fno-omit-frame-pointer)
  target_link_options(langgs_sanitizers INTERFACE ${flags})
endif()
