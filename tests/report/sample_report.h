#pragma once
#include <limits>
#include <string>

#include "weft/report/pictures.h"
#include "weft/report/report.h"

namespace weft::test {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

/// A report with something in every field, and something not finite wherever that may be.
inline Report sample_report() {
  Report report;
  report.title = "Fit of sample";
  report.fabric = "sample cloth";
  report.model = "baraff-witkin";
  report.program_version = "1.2.3";
  report.command = "weft fit sample --out out";
  report.created = "2026-01-02T03:04:05+00:00";
  report.method = "coarse search, then annealing";
  report.seed = 18446744073709551615u;
  report.error_initial = infinity;
  report.error = 0.0123456789012345678;
  report.error_meaning = "per frame and masked pixel";
  report.evaluations = 40;
  report.diverged = 3;
  report.wall_s = 12.5;
  report.threads = 2;
  report.settings = {{"columns", std::int64_t{25}},
                     {"alpha", 0.1},
                     {"integrator", std::string("bdf2")},
                     {"cached", true},
                     {"limit", infinity}};

  ReportParameter bend;
  bend.name = "bend_stiffness";
  bend.unit = "N m";
  bend.meaning = "Resistance to bending.";
  bend.value = 3.2e-5;
  bend.lower = 1e-7;
  bend.upper = 1e-2;
  bend.initial = 1e-5;
  bend.variability_percent = 2.5;
  bend.interval_lower = 0.9 * bend.value;
  bend.interval_upper = 1.2 * bend.value;
  bend.prior_median = 2e-5;
  bend.prior_factor = 3;
  ReportParameter damping = bend;
  damping.name = "bend_damping";
  damping.variability_percent = infinity;
  damping.interval_lower = 0;
  damping.interval_upper = infinity;
  damping.determined = false;
  ReportParameter drag = bend;
  drag.name = "drag_linear";
  drag.value = 10;
  drag.lower = 0;
  drag.upper = 10;
  drag.scale = ReportParameter::Scale::shifted_logarithmic;
  drag.at_bound = ReportParameter::Bound::upper;
  ReportParameter held = bend;
  held.name = "shear_stiffness";
  held.free = false;
  held.tied_to = "bend_stiffness";
  held.variability_percent = std::nullopt;
  report.parameters = {bend, damping, drag, held};

  ReportCertainty& certainty = report.certainty.emplace();
  certainty.clusters = 8;
  certainty.condition = 250;
  certainty.dispersion = 1e-4;
  certainty.frames_per_cluster = 5;
  certainty.noise = 1.25;
  certainty.parameters = {"bend_stiffness", "bend_damping", "drag_linear"};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  certainty.correlation.resize(3, 3);
  certainty.correlation << 1, nan, -0.5, nan, nan, nan, -0.5, nan, 1;
  certainty.covariance.resize(3, 3);
  certainty.covariance << 4e-4, 0, -1e-4, 0, 0, 0, -1e-4, 0, 1e-4;
  certainty.information.resize(3, 3);
  certainty.information << 2500, 0, 10, 0, 0, 0, 10, 0, 10000;

  ReportCapture capture;
  capture.name = "sample";
  capture.description = "a test";
  capture.folder = "captures/sample";
  capture.width = 0.5;
  capture.height = 0.4;
  capture.areal_density = 0.3;
  capture.frame_rate = 30;
  capture.frame_count = 4;
  capture.fit_first = 0;
  capture.fit_last = 1;
  capture.columns = 25;
  capture.rows = 21;
  capture.start = "measured surface";
  for (int k = 0; k < 4; ++k) {
    ReportFrame frame;
    frame.index = k;
    frame.time = k / 30.0;
    frame.validation = k >= 2;
    frame.fold = 10 * (k + 1);
    frame.silhouette = 100 + k;
    frame.error = frame.fold + 0.1 * frame.silhouette;
    frame.distance = ReportDistance{0.001 * (k + 1), 0.002 * (k + 1), 0.005 * (k + 1)};
    capture.frames.push_back(frame);
  }
  report.captures.push_back(capture);

  const double inf = infinity;
  report.history = {{1, "coarse", 5, 5, 0},      {2, "coarse", inf, 5, 0},
                    {3, "coarse", 3, 3, 0},      {4, "anneal", 9, 9, 1},
                    {5, "anneal", inf, 9, 0.5},  {6, "anneal", 7, 7, 0.25},
                    {7, "anneal", 7.5, 7, 0.125}};
  report.searches = {{18446744073709551615u, report.error, 25, true, {3.2e-5, 3.2e-5, 10, 3.2e-5}},
                     {7, inf, 15, false, {1e-7, 0, 0.5, 1e-7}}};
  ReportPerturbation perturbation;
  perturbation.parameter = "bend_stiffness";
  perturbation.relative = {-0.1, 0, 0.1};
  perturbation.error = {1.04, 1, inf};
  perturbation.quadratic[0] = 1;
  perturbation.quadratic[1] = 0;
  perturbation.quadratic[2] = 4;
  report.perturbations.push_back(perturbation);

  ReportSurface surface;
  surface.capture = "sample";
  surface.x_parameter = "stretch_stiffness";
  surface.x_unit = "N/m";
  surface.y_parameter = "bend_stiffness";
  surface.y_unit = "N m";
  surface.y_logarithmic = false;
  surface.x = {1, 10, 100};
  surface.y = {0, 1};
  surface.error.resize(2, 3);
  surface.error << 1, 2, 3, 4, inf, 6;
  surface.x_estimate = 20;
  report.surfaces.push_back(surface);

  ReportMatrix matrix;
  matrix.captures = {"sample", "other"};
  matrix.fabrics = {"a", "b", "c"};
  matrix.error.resize(2, 3);
  matrix.error << 1, 2, 3, 5, 4, inf;
  report.matrix = matrix;
  report.remarks = {"A remark."};
  return report;
}

/// Six distinguishable pictures for each of `frames` frames.
inline CapturePictures sample_pictures(const std::string& capture, int frames) {
  CapturePictures pictures{capture, {}};
  for (int k = 0; k < frames; ++k) {
    FramePictures frame;
    frame.frame = k;
    std::uint8_t shade = static_cast<std::uint8_t>(20 * k);
    for (EncodedPicture* picture :
         {&frame.measured, &frame.simulated, &frame.silhouettes, &frame.measured_angles,
          &frame.simulated_angles, &frame.difference}) {
      ++shade;
      *picture = encode_png({2, 1, {shade, shade, shade, 255, 0, 0}});
    }
    pictures.frames.push_back(frame);
  }
  return pictures;
}

}  // namespace weft::test
