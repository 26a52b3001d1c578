// What sanitizers find in libraries that are not built with them, and that is not handsim's to mend.

// OSMesa keeps a small record of each context's buffer for good, fontconfig its configuration, OpenMPI what
// it has found out about the machine.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libOSMesa\nleak:libfontconfig\n"; }

// ODE's geoms hand the memory of a pose on to each other through an atomic that the sanitizer does not see.
extern "C" const char* __tsan_default_suppressions();
extern "C" const char* __tsan_default_suppressions() { return "race:dxGeom::dxGeom\nrace:dxGeom::~dxGeom\n"; }
