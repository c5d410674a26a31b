// Elementary functions that give the same bits on every processor.
//
// The C library picks its sin, exp and their kin by what the processor can do, and the variants
// differ in the last bit. These use only + - * / and sqrt, which IEEE 754 defines to the bit. They
// are within two units in the last place for the arguments of this project (angles up to 1e5 rad).
#pragma once

namespace gyrofree::elementary {

double sin(double x);
double cos(double x);
double tan(double x);
double atan(double x);
double atan2(double y, double x);
double asin(double x);  // x beyond +-1 counts as +-1
double acos(double x);
double exp(double x);
double log(double x);
double pow(double base, double exponent);  // base > 0

}  // namespace gyrofree::elementary
