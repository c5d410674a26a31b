#include "common/bind_fields.hpp"

namespace gyrofree::detail {
namespace {

template <typename Function>
void define(nb::handle cls, const char* name, Function function) {
  nb::setattr(cls, name,
              nb::cpp_function(std::move(function), nb::is_method(), nb::scope(cls), nb::name(name)));
}

void set_or_refuse(const Access* access, void* self, const char* field, nb::handle value) {
  if (access->set(self, field, value)) return;
  std::string known;
  for (const auto name : access->names(self)) known += (known.empty() ? "" : ", ") + nb::cast<std::string>(name);
  throw nb::attribute_error((std::string(access->name) + " has no field " + field + "; it has " + known).c_str());
}

}  // namespace

void define_fields(nb::handle cls, const Access* access) {
  define(cls, "__init__", [access](nb::handle self, nb::kwargs given) {
    access->construct(nb::inst_ptr<void>(self));
    nb::inst_mark_ready(self);
    for (const auto& [key, value] : given)
      set_or_refuse(access, nb::inst_ptr<void>(self), nb::cast<const char*>(key), value);
  });
  define(cls, "__getattr__", [access](nb::handle self, const char* field) {
    nb::object found = access->get(nb::inst_ptr<void>(self), field, self);
    if (!found.is_valid()) throw nb::attribute_error((std::string(access->name) + " has no " + field).c_str());
    return found;
  });
  define(cls, "__setattr__", [access](nb::handle self, const char* field, nb::handle value) {
    set_or_refuse(access, nb::inst_ptr<void>(self), field, value);
  });
  define(cls, "__dir__", [access](nb::handle self) { return access->names(nb::inst_ptr<void>(self)); });
  define(cls, "__getstate__", [access](nb::handle self) {
    const std::string bits = access->save(nb::inst_ptr<void>(self));
    return nb::bytes(bits.data(), bits.size());
  });
  define(cls, "__setstate__", [access](nb::handle self, const nb::bytes& bits) {
    access->restore(nb::inst_ptr<void>(self), std::string_view(bits.c_str(), bits.size()));
    nb::inst_mark_ready(self);
  });
  define(cls, "__eq__", [access](nb::handle self, nb::handle other) {
    return self.type().is(other.type()) &&
           access->save(nb::inst_ptr<void>(self)) == access->save(nb::inst_ptr<void>(other));
  });
  nb::setattr(cls, "__hash__", nb::none());
}

}  // namespace gyrofree::detail
