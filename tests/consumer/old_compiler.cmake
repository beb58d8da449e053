# A compiler that is too old, or one told to speak an older C++, is named the oldest that will do. The macros stand for it.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")
file(WRITE "${work}/version.cpp" "#include <cairn/version.hpp>\n")
function(expect_words words)
  execute_process(COMMAND "${compiler}" ${ARGN} "-I${source}/include" -E "${work}/version.cpp"
    RESULT_VARIABLE status ERROR_VARIABLE message OUTPUT_QUIET)
  if(status EQUAL 0 OR NOT message MATCHES "${words}")
    message(FATAL_ERROR "${ARGN}: '${words}' was expected, but the compiler says: ${message}")
  endif()
endfunction()
expect_words("gcc 11, clang 14" -std=c++20 -U__GNUC__ -D__GNUC__=10 -U__clang_major__ -D__clang_major__=13)
expect_words("-std=c\\+\\+20" -std=c++17)
run("${compiler}" -std=c++20 "-I${source}/include" -fsyntax-only "${work}/version.cpp")
