# SPDX-License-Identifier: Apache-2.0
# Checks of the text of the sources, and of the installed package. Exit code 77 of a script means skipped.
foreach(check include_layers spdx backend_words format)
  add_test(NAME source.${check} COMMAND sh "${CMAKE_CURRENT_SOURCE_DIR}/checks/${check}.sh"
           WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}")
  set_tests_properties(source.${check} PROPERTIES LABELS check SKIP_RETURN_CODE 77)
endforeach()

if(LANGGS_INSTALL)
  add_test(NAME downstream
           COMMAND sh "${CMAKE_CURRENT_SOURCE_DIR}/checks/downstream.sh" "${CMAKE_COMMAND}" "${PROJECT_BINARY_DIR}"
                   "${CMAKE_GENERATOR}" "${CMAKE_CXX_COMPILER}"
           WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}")
  set_tests_properties(downstream PROPERTIES LABELS downstream TIMEOUT 900 RESOURCE_LOCK build_tree)
endif()
