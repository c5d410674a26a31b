// What this processor can run, asked of the processor itself: compilers answer it each in their way.
#pragma once

#if defined(__x86_64__)
#include <cpuid.h>
#endif

namespace gyrofree {

#if defined(__x86_64__)

namespace detail {

// Does the operating system keep the wide registers over a change of task?
inline bool wide_registers_are_kept() {
  unsigned low = 0;
  unsigned high = 0;
  constexpr unsigned VECTOR_STATES = 6;  // 128-bit and 256-bit registers
  __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
  return (low & VECTOR_STATES) == VECTOR_STATES;
}

}  // namespace detail

// Does it run x86-64-v3, the level of AVX2, by the list of the x86-64 psABI?
inline bool runs_v3() {
  constexpr unsigned BASIC = bit_FMA | bit_MOVBE | bit_OSXSAVE | bit_AVX | bit_F16C;
  constexpr unsigned STRUCTURED = bit_BMI | bit_AVX2 | bit_BMI2;
  unsigned a = 0, b = 0, c = 0, d = 0;
  if (!__get_cpuid(1, &a, &b, &c, &d) || (c & BASIC) != BASIC) return false;
  if (!detail::wide_registers_are_kept()) return false;
  if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || (b & STRUCTURED) != STRUCTURED) return false;
  return __get_cpuid(0x80000001, &a, &b, &c, &d) && (c & bit_LZCNT) != 0;
}

#else

inline bool runs_v3() { return false; }

#endif

}  // namespace gyrofree
