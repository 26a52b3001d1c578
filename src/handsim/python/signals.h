// Work without the GIL that Ctrl-C ends: it now and then calls what runs Python's signal handlers.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <mutex>
#include <thread>

#include <pybind11/pybind11.h>

#include "handsim/core/error.h"

namespace handsim::python {

namespace py = pybind11;

/// A handler or callback raised; the error indicator is set. No std::exception: the library did not fail.
struct Interrupted {};

inline constexpr std::chrono::milliseconds kSignalInterval{50};  ///< Between two runs of the handlers.

/// Runs work without the GIL. @throws py::error_already_set where a handler has raised.
template <class Work>
auto without_gil(Work&& work) {
  try {
    const py::gil_scoped_release release;
    return work();
  } catch (const Interrupted&) {
    throw py::error_already_set();
  }
}

/// An object's calls, without the GIL: one thread at a time. One from within another is an Error (input).
class Calls {
 public:
  template <class Work>
  auto one(Work&& work) {
    if (thread_ == std::this_thread::get_id())
      throw input_error("call", "a call from within another one of the same object", "a call after it");
    return without_gil([&] {
      const std::lock_guard lock(mutex_);
      thread_ = std::this_thread::get_id();
      struct End {
        std::atomic<std::thread::id>& thread;
        ~End() { thread = std::thread::id(); }
      } const end{thread_};
      return work();
    });
  }

 private:
  std::mutex mutex_;
  std::atomic<std::thread::id> thread_;  ///< that is in a call
};

/// Looks for signals, such as Ctrl-C, in loops of the thread that has called from Python.
class Signals {
 public:
  /// @param progress called with the share done, 0..1; may be None.
  explicit Signals(const py::object& progress = py::none())
      : progress_(progress.is_none() ? nullptr : progress.ptr()) {}

  /// Every kSignalInterval runs the handlers and `progress`. Call without the GIL. @throws Interrupted
  void poll(double share) {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_) return;
    const py::gil_scoped_acquire gil;
    run(share);
    next_ = std::chrono::steady_clock::now() + kSignalInterval;
  }

 private:
  /// With the GIL.
  void run(double share) const {
    if (PyErr_CheckSignals() != 0) throw Interrupted{};
    if (progress_ == nullptr) return;
    try {
      py::handle{progress_}(share);
    } catch (py::error_already_set& error) {
      error.restore();
      throw Interrupted{};
    }
  }

  PyObject* progress_;  ///< the caller has a reference
  std::chrono::steady_clock::time_point next_ = std::chrono::steady_clock::now() + kSignalInterval;
  template <class Study>
  friend auto run_study(const py::object& progress, Study&& study);
};

/// Hooks of a study: who is told the share done, and a flag that ends it.
struct StudyHooks {
  std::function<void(double)> told;  ///< throws Interrupted once the study is to end
  std::atomic<bool> stop = false;
  std::atomic<double> share = 0;
};

/// Runs a study, with threads of its own, in another thread, and Python's signal handlers in this one, which
/// end it when it next tells its share. @param study called with StudyHooks&
template <class Study>
auto run_study(const py::object& progress, Study&& study) {
  StudyHooks hooks;
  hooks.told = [&hooks](double share) {
    if (hooks.stop) throw Interrupted{};
    hooks.share = share;
  };
  const Signals signals(progress);
  auto result = std::async(std::launch::async, [&] { return study(hooks); });
  for (;;) {
    bool ready = false;
    {
      const py::gil_scoped_release release;
      ready = result.wait_for(kSignalInterval) == std::future_status::ready;
    }
    if (ready) break;
    if (hooks.stop) continue;
    try {
      signals.run(hooks.share);
    } catch (const Interrupted&) {
      hooks.stop = true;
    }
  }
  if (hooks.stop) throw py::error_already_set();
  return result.get();
}

}  // namespace handsim::python
