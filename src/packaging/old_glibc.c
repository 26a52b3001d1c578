// Names that libstdc++ 12 and handsim want and glibc 2.28 has not.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <spawn.h>
#include <stdint.h>
#include <sys/random.h>
#include <sys/syscall.h>
#include <unistd.h>

#define HIDDEN __attribute__((visibility("hidden")))

// 2.32. No short cut for processes with one thread.
HIDDEN char __libc_single_threaded = 0;

// 2.36, of std::random_device.
HIDDEN uint32_t arc4random(void) {
  uint32_t out = 0;
  while (getrandom(&out, sizeof out, 0) != sizeof out) {
  }
  return out;
}

// 2.34. A kernel before 5.9 has no such call.
HIDDEN int close_range(unsigned first, unsigned last, int flags) {
  if (syscall(436, first, last, flags) == 0) return 0;
  const long most = sysconf(_SC_OPEN_MAX);
  for (unsigned file = first; file <= last && file < most && file < 65536; ++file) close((int)file);
  return 0;
}

// 2.29. Without it the program is not started: as if it was missing.
HIDDEN int posix_spawn_file_actions_addchdir_np(posix_spawn_file_actions_t* actions, const char* path) {
  int (*found)(posix_spawn_file_actions_t*, const char*) = NULL;
  *(void**)&found = dlsym(RTLD_DEFAULT, "posix_spawn_file_actions_addchdir_np");
  return found ? found(actions, path) : posix_spawn_file_actions_addopen(actions, 9, "/proc/none", 0, 0);
}
