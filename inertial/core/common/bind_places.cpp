// The Earth for Python: the C++ of common/earth.hpp, for tests against its numpy twin.
#include "common/earth.hpp"
#include "common/python.hpp"

namespace gyrofree {

void bind_places(nb::module_& m) {
  nb::module_ e = m.def_submodule("earth", "One place at a time; arrays of them: inertial.earth.");
  e.def("radii",
        [](double latitude) {
          const earth::Radii r = earth::radii(latitude);
          return nb::make_tuple(r.north, r.east);
        },
        nb::arg("latitude"));
  e.def("gravity", &earth::gravity, nb::arg("latitude"), nb::arg("height"));
  e.def("earth_rate", [](double latitude) { return to_numpy_vector(earth::earth_rate(latitude)); },
        nb::arg("latitude"));
  e.def("transport_rate",
        [](double latitude, double height, double north, double east) {
          return to_numpy_vector(earth::transport_rate(latitude, height, north, east));
        },
        nb::arg("latitude"), nb::arg("height"), nb::arg("v_north"), nb::arg("v_east"));
  e.def("ned_between",
        [](double latitude0, double longitude0, double height0, double latitude, double longitude, double height) {
          return to_numpy_vector(
              earth::ned_between({latitude0, longitude0, height0}, {latitude, longitude, height}));
        },
        "Metres north, east and down of the second place from the first.");
}

}  // namespace gyrofree
