// Whether tests run under a sanitizer, which takes many times as long and keeps freed memory for a while.
#pragma once

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define HANDSIM_SANITIZED 1
#endif
#if __has_feature(address_sanitizer)
#define HANDSIM_ADDRESS_SANITIZED 1
#endif
#endif

namespace handsim::test {

#ifdef HANDSIM_SANITIZED
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

/// Of tests with drawn input: of 100.
inline constexpr int kDrawnCases = kSanitized ? 40 : 100;

}  // namespace handsim::test

/// For tests that repeat much of what shorter ones run: with a sanitizer they would take minutes and read no
/// other code.
#define HANDSIM_SKIP_WITH_SANITIZER(why) \
  if (handsim::test::kSanitized) GTEST_SKIP() << "not with a sanitizer: " << (why)
