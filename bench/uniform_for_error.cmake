if(TARGET tessera_io)
  tessera_program(uniform_for_error SOURCES uniform_for_error.cpp LINK io brick PRIVATE_LINK fmt::fmt)
endif()
