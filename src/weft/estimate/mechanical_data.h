#pragma once
/// Forces and shapes at equilibrium beside videos of the same fabric, in one problem.
#include <memory>

#include "weft/estimate/mechanical_problem.h"
#include "weft/estimate/problem.h"

namespace weft {

/// The mechanical captures as data besides a video's: their cost divided by its dispersion
/// (cluster_dispersion() over the frames), which makes it minus the logarithm of a likelihood, as
/// the video's is with its own. The dispersion is that at `estimate`, scaled coordinates, where
/// `problem` fits best by itself, and not below what the stated noise makes, 2 / residual_count.
/// Forces are weighed as `problem` is, or, where it is not, as at `estimate`. `problem` must have
/// the free parameters of the video's problem, in its order. Evaluations are remembered. Throws
/// Error where `estimate` has no equilibrium.
OtherData mechanical_data(std::shared_ptr<const MechanicalProblem> problem, const VecX& estimate);

}  // namespace weft
