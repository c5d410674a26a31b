// The hot loops of inertial/, as one Python module. Each subject binds itself.
#include "common/python.hpp"

namespace {

// Does this processor run the x86-64-v3 build?
bool runs_v3() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
#else
  return false;
#endif
}

}  // namespace

NB_MODULE(GYROFREE_MODULE, m) {
  m.doc() = "Hot loops of the estimators: the same bits on every processor.";
  m.def("runs_v3", &runs_v3, "True where this processor runs the x86-64-v3 build of the core.");
  gyrofree::bind_elementary(m);
  gyrofree::bind_rotation(m);
  gyrofree::bind_earth(m);
}
