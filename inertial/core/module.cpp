// The hot loops of inertial/, as one Python module. Each subject binds itself.
#include "common/python.hpp"

NB_MODULE(GYROFREE_MODULE, m) {
  m.doc() = "Hot loops of the estimators: the same bits on every processor.";
  m.attr("VERSION") = GYROFREE_VERSION;
  gyrofree::bind_elementary(m);
  gyrofree::bind_rate(m);
  gyrofree::bind_rotation(m);
  gyrofree::bind_places(m);
  gyrofree::bind_attitude(m);
  gyrofree::bind_alignment(m);
  gyrofree::bind_health(m);
  gyrofree::bind_navigation(m);
}
