# Ends the configuration with one line if the core can't be compiled for this target or by this compiler.
if(CMAKE_CXX_COMPILER_ID STREQUAL "MSVC")
  message(FATAL_ERROR "wive: expected GCC, Clang or clang-cl, got MSVC's cl, which lacks their vector types and 128-bit"
    " integers: on Windows install Clang and set CC=clang-cl CXX=clang-cl, with Ninja as the generator")
endif()
if(CMAKE_CXX_BYTE_ORDER STREQUAL "BIG_ENDIAN")
  message(FATAL_ERROR "wive: expected a little-endian target, got ${CMAKE_SYSTEM_PROCESSOR}, which is big-endian: trees"
    " are stored and shared in little-endian byte order; there is no form of the core for others")
endif()
if(CMAKE_SIZEOF_VOID_P AND CMAKE_SIZEOF_VOID_P LESS 8)
  message(FATAL_ERROR "wive: expected a 64-bit target, got ${CMAKE_SYSTEM_PROCESSOR} with pointers of"
    " ${CMAKE_SIZEOF_VOID_P} bytes: use a 64-bit Python, whose compiler has integers of 128 bits")
endif()
