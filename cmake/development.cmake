# Settings of this project's own targets. Nothing here reaches a user's project.

if(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

option(CAIRN_WARNINGS_AS_ERRORS "Treat warnings as errors" ${PROJECT_IS_TOP_LEVEL})
set(CAIRN_SANITIZE "" CACHE STRING "Sanitizers of the project's own targets, e.g. address,undefined")
option(CAIRN_FUZZ "Build the fuzz targets of tests/fuzz as programs of clang's libFuzzer" OFF)
option(CAIRN_LONG_TESTS "Build the tests that take longest to compile too" ON)
option(CAIRN_PLAIN_REPLAYS "Replay the headers' fuzz corpora without sanitizers too" ON)
option(CAIRN_NATIVE "Compile the project's own targets with -march=native" OFF)

add_library(cairn_development INTERFACE)
target_link_libraries(cairn_development INTERFACE cairn::cairn)
target_compile_options(cairn_development INTERFACE
  -Wall -Wextra -Wconversion -Wshadow
  $<$<BOOL:${CAIRN_WARNINGS_AS_ERRORS}>:-Werror>
  # gcc 12 would otherwise collect garbage all the time: an eighth of its seconds, for a fifth of memory more.
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1000000>
  $<$<BOOL:${CAIRN_NATIVE}>:-march=native>
  # gcc 12's own AVX-512 intrinsics, inlined into Eigen, read "undefined" registers (gcc bug 105593).
  $<$<AND:$<BOOL:${CAIRN_NATIVE}>,$<CXX_COMPILER_ID:GNU>>:-Wno-uninitialized;-Wno-maybe-uninitialized>)
if(CAIRN_SANITIZE)
  # Null, overflowing and out-of-object pointers fault or reach the address sanitizer as well; checking each by itself
  # makes the objects 1.7 times as large and a third slower to compile.
  target_compile_options(cairn_development INTERFACE
    -fsanitize=${CAIRN_SANITIZE} $<$<NOT:$<BOOL:${CAIRN_FUZZ}>>:-fno-sanitize=null,pointer-overflow,object-size,vptr>
    -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(cairn_development INTERFACE -fsanitize=${CAIRN_SANITIZE})
endif()
if(CAIRN_FUZZ)
  target_compile_options(cairn_development INTERFACE -fsanitize=fuzzer-no-link)  # the fuzzer sees which way was taken
endif()
if(CAIRN_COMPILED AND NOT CAIRN_NATIVE)  # whose registers are wider than the library's
  target_link_libraries(cairn_development INTERFACE cairn_compiled)
  target_compile_options(cairn_compiled PRIVATE $<TARGET_PROPERTY:cairn_development,INTERFACE_COMPILE_OPTIONS>)
endif()
