# An installed cairn does not stand in for another minor version.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")
install_cairn()
string(REGEX MATCH "^([0-9]+)\\.([0-9]+)" _ "${version}")
math(EXPR next_minor "${CMAKE_MATCH_2} + 1")
math(EXPR next_major "${CMAKE_MATCH_1} + 1")
foreach(other IN ITEMS "${CMAKE_MATCH_1}.${next_minor}" "${next_major}.0")
  execute_process(
    COMMAND "${CMAKE_COMMAND}" -S "${project}" -B "${work}/user-${other}" -G "${generator}"
      -D "CMAKE_CXX_COMPILER=${compiler}" -D "CMAKE_PREFIX_PATH=${prefix}" -D "cairn_version=${other}"
    RESULT_VARIABLE status ERROR_VARIABLE message OUTPUT_QUIET)
  if(status EQUAL 0 OR NOT message MATCHES "version: ${version}")
    message(FATAL_ERROR "cairn ${version} was taken for ${other}, or refused with another message:\n${message}")
  endif()
endforeach()
