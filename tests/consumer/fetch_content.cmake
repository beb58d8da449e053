# FetchContent brings cairn's folder, and a host that has a target Eigen3::Eigen of its own keeps it.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")
configure("${project}" "${work}/user" -D "cairn_fetched_from=${source}" -D CMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON
  -D "eigen_headers=${eigen_headers}")
build_and_run("${work}/user")
