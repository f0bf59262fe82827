/* The C code of the model, in a unit of its own, as its names are its own matter. Its functions are not visible
   outside of the FMU. The headers that it includes stand here first, so that they are not hidden. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off") /* no a * b + c in one rounding: same numbers on every machine */
#endif

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif
#include "softstart_model.h"

#include MODEL_SOURCE
#if defined(__GNUC__)
#pragma GCC visibility pop
#endif
