#pragma once

#include <stdexcept>

namespace tessera {

/// Bad input or usage: the message names the file, element or option, what was expected and what came.
class InputError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// Reading a file asked for more memory than there is: it is damaged, or too large.
class TooLargeError : public InputError {
  public:
    using InputError::InputError;
};

/// The environment failed: a file that can't be written, a full disk.
class IoError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// OpenGL is absent or failed.
class GlError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The caller asked to stop (`Execution::cancel`).
class Cancelled : public std::runtime_error {
  public:
    Cancelled() : std::runtime_error("cancelled") {}
};

/// A bug in Tessera itself: the message names the place in its sources.
class InternalError : public std::logic_error {
  public:
    using std::logic_error::logic_error;
};

}  // namespace tessera
