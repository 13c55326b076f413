#pragma once
/// What a test of bending by itself tells of a fabric, as priors for a fit to other data
/// (fabric/prior.h).
#include <vector>

#include "weft/fabric/fabric.h"
#include "weft/fabric/prior.h"

namespace weft {

/// Of a parameter on a logarithmic scale, the prior with the probability `confidence` between
/// `lower` and `upper` and as much beyond either: with the normal quantile q of (1 + confidence) /
/// 2
///
///     median = sqrt(lower upper),    factor = (upper / lower)^(1 / (2 q)).
///
/// Throws Error unless 0 < lower < upper, both finite, and 0 < confidence < 1.
ParameterPrior prior_of_interval(std::string parameter, double lower, double upper,
                                 double confidence = 0.9);

/// Of all constants of bend (unit N m, but for ends of curves) of `fabric`, of which one factor is
/// known to be in an interval, as fit_drape() finds it. Priors are independent of each other: n of
/// them, each as wide as the factor's, would state it n times. So each has the n-th root of the
/// sum's information, log(factor) sqrt(n) times that of prior_of_interval(): together they say of a
/// common factor what is known of it. Of the proportions between the constants, which the test
/// takes as given, they say that these are no further off than that.
///
/// Throws Error as prior_of_interval(), for a bend that is a curve or not searched on a logarithmic
/// scale, and for a median outside the range of its parameter.
std::vector<ParameterPrior> priors_of_factor(const Fabric& fabric, double lower, double upper,
                                             double confidence = 0.9);

/// Of a rigidity B by an overhang (cantilever.h) that was read with the standard deviation
/// `deviation` (m): B goes with the third power of the overhang L, so that log B has the standard
/// deviation 3 deviation / L. Throws Error unless both are above 0, and where the factor is outside
/// of what a prior may have.
ParameterPrior prior_of_overhang(std::string parameter, double rigidity, double overhang,
                                 double deviation);

}  // namespace weft
