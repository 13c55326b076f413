#pragma once
/// The overhang at which a computed strip reaches the angle of its test (overhang.h).
///
/// With phi(L) the angle below the horizontal of the line from the edge to the middle of the tip of
/// a strip that overhangs by L, the overhang is the L with phi(L) = alpha. It is found by the
/// secant rule on log(tan phi / cos(phi / 2)) over log L, which is a straight line of slope 3 for
/// the elastica as Peirce has it, and nearly so for others. Meshes of all lengths are that of the
/// mean reading, stretched beyond the edge. By the parameters p of the model
///
///     dL / dp = - (d phi / d p) / (d phi / d L),
///
/// d phi / d p by the sensitivities of the equilibrium there (clips.h), d phi / d L by the central
/// difference of equilibria that are 0.1 % longer and shorter (an error of some 1e-6 of it).
#include <string>
#include <vector>

#include "weft/estimate/mechanical_trial.h"

namespace weft {

/// Adds the overhang to `frame`, an equilibrium of the trial's mesh, whose capture is of an
/// overhang test: `overhang`, and with MechanicalDerivatives::all `overhang_derivative`. Internal
/// friction counts from flat. Where no strip of 1 mm to 10 m reaches the angle, or one has no
/// equilibrium, the frame counts as not converged and its overhang is no number.
void add_overhang(const MechanicalTrial& trial, const Fabric& fabric,
                  MechanicalDerivatives derivatives, MechanicalFrame& frame);

/// Angle (rad) below the horizontal of the line from the edge to the middle of the tip of a shape
/// (3 x vertices of `mesh`) of a capture of an overhang test.
double chord_angle(const MechanicalCapture& capture, const TriangleMesh& mesh, const Points& x);

/// Why the overhang of a frame is not known; empty where it is, and for captures of other tests.
std::string overhang_problem(const MechanicalTrial& trial, const MechanicalFrame& frame);

/// Computed less measured, over the deviation of a reading.
double overhang_residual(const OverhangTest& test, const MechanicalFrame& frame);

OverhangDifference overhang_difference(const OverhangTest& test,
                                       const std::vector<MechanicalFrame>& frames);

/// The middle of a shape's strip, from the edge to the tip: x, z relative to the edge, m.
MaterialPoints middle_line(const MechanicalCapture& capture, const TriangleMesh& mesh,
                           const Points& x);

}  // namespace weft
