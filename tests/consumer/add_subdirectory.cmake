# A project includes cairn's folder. It gets the target and nothing else: see project/nothing_leaks.cmake; its own install
# holds its own program alone.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")
configure("${project}" "${work}/user" -D "cairn_folder=${source}")
build_and_run("${work}/user")
run("${CMAKE_COMMAND}" --install "${work}/user" --prefix "${prefix}")
file(GLOB_RECURSE installed RELATIVE "${prefix}" "${prefix}/*")
if(NOT installed STREQUAL "bin/program")
  message(FATAL_ERROR "the user's install should hold bin/program alone, but holds: ${installed}")
endif()
