// Built while configuring, no part of handsim: links where ODE's headers and library are in double precision.
#include <ode/ode.h>

static_assert(sizeof(dReal) == sizeof(double), "single precision");

int main() { return dCheckConfiguration("ODE_double_precision") ? 0 : 1; }
