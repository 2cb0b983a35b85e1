# SPDX-License-Identifier: Apache-2.0
# Runs of the programs as a user makes them. Exit code 77 of a script means skipped.
foreach(check end_to_end real_data)
  add_test(NAME program.${check} COMMAND sh "${CMAKE_CURRENT_SOURCE_DIR}/checks/${check}.sh"
                                         $<TARGET_FILE:langgs_slam> "${PROJECT_BINARY_DIR}/program/${check}")
  set_tests_properties(program.${check} PROPERTIES LABELS examples TIMEOUT 1200 SKIP_RETURN_CODE 77 COST 50)
endforeach()
