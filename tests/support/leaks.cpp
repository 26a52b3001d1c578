// Under the leak sanitizer: OSMesa keeps a small record of each context's buffer for good, and fontconfig
// its configuration. Neither is handsim's to free.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libOSMesa\nleak:libfontconfig\n"; }
