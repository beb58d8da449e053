# cmake --install, then a project finds cairn by its version and links every header twice.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")
install_cairn()
configure("${project}" "${work}/user" -D "CMAKE_PREFIX_PATH=${prefix}" -D "cairn_version=${version}"
  -D "header_folder=${prefix}/include")
build_and_run("${work}/user")
