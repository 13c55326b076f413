#pragma once
/// What a report shows of mechanical captures, as plain values (like report.h).
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "weft/report/pictures.h"
#include "weft/report/plot.h"
#include "weft/report/report.h"

namespace weft {

/// Force of a clip along its way.
struct ReportClip {
  std::string name;
  /// Distance of the clip from where it was at the first frame, less that of the first clip where
  /// both move; m. One a frame. All zero for a clip that stands still.
  std::vector<double> moved;
  /// Components along the direction of the largest measured force, N; NaN: not measured.
  std::vector<double> measured, computed;
  /// Of the computed force, from the uncertainty of the parameters; empty where there is none.
  std::vector<double> lower, upper;
};

/// Where a clip is that is pulled with known forces.
struct ReportLoadedClip {
  std::string name;
  std::vector<double> force;  ///< of cords and weight together, N; one a frame
  /// Way from where it was measured at the first frame, along the largest force, m; one a frame.
  /// Computed: NaN without equilibrium.
  std::vector<double> measured, computed;
  /// Of the computed way, from the uncertainty of the parameters; empty where there is none.
  std::vector<double> lower, upper;
};

/// Root mean squares of the differences of loaded clips' poses.
struct ReportPose {
  double position = 0;  ///< m
  double rotation = 0;  ///< rad
};

/// How often a strain occurs, by area and over all frames.
struct ReportHistogram {
  std::string name;  ///< "weft stretch"
  std::string unit;  ///< "" or "1/m"
  double lower = 0, upper = 0;
  std::vector<double> share;  ///< of equal bins between lower and upper; adds up to 1
};

struct ReportMechanicalFrame {
  int index = 0;
  bool converged = true;
  double force_rms = std::numeric_limits<double>::quiet_NaN();  ///< N; NaN: no force measured
  std::optional<ReportDistance> distance;                       ///< to the measured shape
};

/// A frame's shape, measured and computed, from the same view.
struct ReportShape {
  int frame = 0;
  EncodedPicture measured, computed;
};

/// The force of a clamp of a scan.
struct ReportClampForce {
  std::string name;
  std::optional<double> measured;  ///< N, magnitude
  double noise = 0;                ///< N, standard deviation, of a measured one
  double computed = 0;             ///< N, magnitude
};

/// How a grid lies on a raw scan.
struct ReportRegistration {
  int points = 0, inliers = 0;                  ///< of the scan; those that were used
  double residual_median = 0, residual_95 = 0;  ///< m, of the inliers' distances to the grid
  double strain_rms = 0;                        ///< of the grid's edges
  int vertices = 0, unsupported = 0;            ///< of the grid; those without points near them
};

/// Friction of the cords that pull the clips of a capture.
struct ReportCordFriction {
  double value = 0;             ///< N
  double lower = 0, upper = 0;  ///< 90 % interval, N
  bool determined = true;
};

/// An overhang test (computed_overhang.h).
struct ReportOverhang {
  double angle = 0;                    ///< rad below the horizontal
  double deviation = 0;                ///< m, of a reading
  std::vector<double> measured;        ///< m, readings
  double computed = 0;                 ///< m; NaN: none
  std::optional<double> lower, upper;  ///< m, 90 % interval of the computed; both or neither
  /// Middle of the computed strip where it overhangs by the mean of the readings, from the edge: m,
  /// away from it and up.
  std::vector<double> x, z;

  double mean() const;
};

/// One mechanical capture at the estimate.
struct ReportMechanical {
  std::string name, description, folder;
  double width = 0, height = 0;                                 ///< swatch, m
  double areal_density = 0;                                     ///< kg/m^2
  double grain_angle = 0;                                       ///< rad
  int point_count = 0;                                          ///< of the measured shape
  double force_rms = 0, force_relative = 0, force_largest = 0;  ///< N, 1, N
  int force_count = 0;                                          ///< measured components
  std::optional<ReportDistance> distance;
  double full_distance = 0;  ///< m, at which the colour of `shapes` ends
  std::vector<ReportMechanicalFrame> frames;
  std::vector<ReportClip> clips;
  std::vector<ReportLoadedClip> loaded;
  std::optional<ReportPose> pose;  ///< of the loaded clips
  std::vector<ReportHistogram> strains;
  std::vector<ReportShape> shapes;
  std::vector<ReportClampForce> clamps;             ///< of a scan
  std::optional<ReportRegistration> registration;   ///< of a raw scan
  std::optional<ReportCordFriction> cord_friction;  ///< where it was fitted
  std::optional<ReportOverhang> overhang;           ///< of an overhang test
};

/// Stress against strain of the fabric (model/material_response.h).
struct ReportResponse {
  std::string name;                      ///< "weft stretch"
  std::string strain_unit, stress_unit;  ///< "" and "N/m"; "1/m" and "N"
  /// With internal friction in the order of a cycle: from rest up, down, and up again.
  std::vector<double> strain, stress;
  std::vector<double> lower, upper;  ///< of the stress; empty where there is no uncertainty
  /// Where the cycle turns: indices into `strain`, ascending; empty without internal friction.
  std::vector<std::size_t> turns;
};

/// A number that follows from the parameters, such as a Young's modulus.
struct ReportModulus {
  std::string name, unit, meaning;
  double value = 0;
  std::optional<double> lower, upper;  ///< 90 % interval; both or neither
};

/// One least-squares fit on the way to the estimate.
struct ReportStage {
  std::string name;                   ///< "shear", "shear, half the cells"
  int pass = 1;                       ///< from 1
  std::vector<std::string> captures;  ///< that it used
  int points = 1;                     ///< control points of its curve
  double error_initial = 0, error = 0;
  /// On cells of half the width; NaN: not asked.
  double error_on_halved_cells = std::numeric_limits<double>::quiet_NaN();
  std::size_t evaluations = 0;
  bool kept = true;  ///< false: its parameters were not taken over
};

struct MechanicalReport {
  std::vector<ReportMechanical> captures;
  std::vector<ReportResponse> responses;
  std::string response_remark;  ///< a sentence that goes with `responses`; may be empty
  std::vector<ReportModulus> moduli;
  std::vector<ReportStage> stages;
};

/// Force against the way of the clip that moves most, measured as points, computed as a line with
/// its band; against the frame where none moves. A loop shows as two branches.
LinePlot force_plot(const ReportMechanical& capture);
/// Way of the loaded clips against the known force, measured as points, computed as a line with its
/// band; against the frame where no force changes.
LinePlot loaded_plot(const ReportMechanical& capture);
/// Distance to the measured shape by frame, mean and largest, mm.
LinePlot shape_distance_plot(const ReportMechanical& capture);
/// The computed strip from the side and the inclined plane, mm, both axes of about one scale;
/// `width` px.
LinePlot overhang_plot(const ReportOverhang& overhang, int width = 700);
LinePlot strain_plot(const ReportHistogram& histogram);
/// With internal friction a line a branch: "from rest", "unloading", "loading".
LinePlot response_plot(const ReportResponse& response);

/// A surface from above and in front, orthographic, lit from the viewer: coloured by `values` (one
/// a vertex) from 0 to `full` with viridis, or plain grey where `values` is empty. Every picture of
/// points that lie in `box` has the same scale. `up` points to the top.
struct ShapeView {
  Vec3 lower, upper;  ///< box that is seen, m
  Vec3 up{0, 0, 1};
  int width = 420;  ///< px
};
Picture shape_picture(const TriangleMesh& mesh, const Points& x, const VecX& values, double full,
                      const ShapeView& view);

}  // namespace weft
