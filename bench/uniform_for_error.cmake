if(TARGET tessera_vdb)
  tessera_program(uniform_for_error SOURCES uniform_for_error.cpp LINK reader vdb PRIVATE_LINK fmt::fmt)
endif()
