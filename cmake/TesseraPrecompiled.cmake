# Precompiled headers: parsing the standard headers is about a third of a clean build. They are off with a compiler launcher such as
# ccache, which couldn't cache the files that use them.

set(precompile ON)
if(CMAKE_CXX_COMPILER_LAUNCHER)
  set(precompile OFF)
endif()
option(TESSERA_PRECOMPILE "Parse the common headers once, in precompiled headers" ${precompile})

set(TESSERA_COMMON_HEADERS
  <algorithm> <array> <atomic> <charconv> <chrono> <cmath> <cstdint> <cstring> <deque> <exception> <filesystem> <functional>
  <future> <limits> <map> <memory> <mutex> <numeric> <optional> <random> <set> <span> <sstream> <stdexcept> <string>
  <string_view> <thread> <tuple> <unordered_map> <utility> <variant> <vector>)

# tessera_precompiled_headers(<target> LINK <libraries> HEADERS <headers>): a target that holds a precompiled header of
# the common headers and these, for tessera_precompile.
function(tessera_precompiled_headers target)
  cmake_parse_arguments(ARG "" "" "LINK;HEADERS" ${ARGN})
  if(TESSERA_PRECOMPILE)
    file(WRITE ${PROJECT_BINARY_DIR}/precompiled/${target}.cpp "")
    add_library(${target} OBJECT ${PROJECT_BINARY_DIR}/precompiled/${target}.cpp)
    target_compile_features(${target} PRIVATE cxx_std_20)
    target_link_libraries(${target} PRIVATE ${ARG_LINK} tessera_flags)
    target_precompile_headers(${target} PRIVATE ${TESSERA_COMMON_HEADERS} ${ARG_HEADERS})
  endif()
endfunction()

# tessera_precompile(<target> [<holder>]): the target's sources start from the holder's precompiled header, tessera_precompiled for one.
function(tessera_precompile target)
  if(TESSERA_PRECOMPILE)
    set(holder tessera_precompiled)
    if(ARGC GREATER 1)
      set(holder ${ARGV1})
    endif()
    target_precompile_headers(${target} REUSE_FROM ${holder})
  endif()
endfunction()

tessera_precompiled_headers(tessera_precompiled)
