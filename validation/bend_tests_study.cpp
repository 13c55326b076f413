#include <fmt/format.h>

#include <cmath>

#include "textile_studies.h"
#include "weft/estimate/cantilever.h"
#include "weft/estimate/tabulated_curve.h"
#include "weft/report/plot.h"
#include "weft/vision/strip_profile.h"

namespace weft::validation {
namespace {

// Of the photograph: a glass fabric of 13.6 N/m^2.
constexpr double kWeight = 13.6, kPixel = 0.1101e-3;

std::vector<double> list(const VecX& values) { return {values.begin(), values.end()}; }

MaterialPoints published_profile(const std::filesystem::path& folder) {
  const MatX x = read_rows(folder / "test_image_expected_x.csv");
  const MatX y = read_rows(folder / "test_image_expected_y.csv");
  MaterialPoints profile(2, x.rows());
  profile.row(0) = x.col(0).transpose();
  profile.row(1) = y.col(0).transpose();
  return profile;
}

MaterialPoints photographed_profile(const std::filesystem::path& picture) {
  MaterialPoints profile = find_strip_profile(read_grey_image(picture)) * kPixel;
  profile.row(1) *= -1;
  const Vec2 clamp = profile.col(0);
  return profile.colwise() - clamp;
}

/// Largest distance from the points of `profile` to the polygon `reference`.
VecX distances(const MaterialPoints& profile, const MaterialPoints& reference) {
  VecX out(profile.cols());
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    double least = 1e9;
    for (Eigen::Index j = 1; j < reference.cols(); ++j) {
      const Vec2 a = reference.col(j - 1), b = reference.col(j), p = profile.col(i);
      const double t = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
      least = std::min(least, (p - a - t * (b - a)).norm());
    }
    out[i] = least;
  }
  return out;
}

void report_profile(const std::string& name, const MaterialPoints& profile, double published,
                    LinePlot& shapes, LinePlot& laws) {
  const MomentCurvature found = moment_curvature(profile, kWeight);
  fmt::print("{}: {} points, length {:.4f} m, tip at ({:.4f}, {:.4f}) m\n", name, profile.cols(),
             found.arc[found.arc.size() - 1], profile(0, profile.cols() - 1),
             profile(1, profile.cols() - 1));
  fmt::print("  root moment {:.4f} N, published {:.4f} N: {:+.2f} %\n", found.moment[0], published,
             100 * (found.moment[0] / published - 1));
  PlotSeries shape;
  shape.name = name;
  shape.x = list(1e3 * profile.row(0).transpose());
  shape.y = list(1e3 * profile.row(1).transpose());
  shapes.series.push_back(shape);
  PlotSeries law;
  law.name = name + ", from the curvature of the profile";
  law.mark = PlotSeries::Mark::points;
  law.x = list(found.curvature);
  law.y = list(found.moment);
  laws.series.push_back(law);
  for (const BendTerms terms : {BendTerms::constant, BendTerms::friction}) {
    const CantileverFit fit = fit_cantilever(profile, kWeight, terms);
    const bool friction = terms == BendTerms::friction;
    fmt::print("  {}: B {:.4g} N m", friction ? "with friction" : "constant",
               fit.law.bend.stiffness(0));
    if (friction)
      fmt::print(", friction {:.3g} N over {:.3g} 1/m", fit.law.friction, fit.law.friction_scale);
    fmt::print(", clamp at {:.1f} degrees; distance rms {:.2f}, max {:.2f} mm\n",
               fit.root_angle * 180 / M_PI, 1e3 * fit.distance_rms, 1e3 * fit.distance_max);
    const ElasticaProfile bent =
        heavy_elastica(fit.law, kWeight, found.arc[found.arc.size() - 1], fit.root_angle);
    PlotSeries series;
    series.name = name + (friction ? ", elastica with friction" : ", elastica, constant");
    series.dashed = !friction;
    series.x = list(1e3 * bent.at.row(0).transpose());
    series.y = list(1e3 * bent.at.row(1).transpose());
    if (name == "photograph") shapes.series.push_back(series);
    series.x = list(bent.curvature);
    series.y = list(bent.moment);
    laws.series.push_back(series);
  }
}

PlotAxis axis(const char* label, const char* unit) {
  PlotAxis out;
  out.label = label;
  out.unit = unit;
  return out;
}

}  // namespace

void study_photographed_cantilever(const StudyFolders& folders) {
  const auto folder = folders.data / "cantilever";
  const MatX moment = read_rows(folder / "test_image_expected_moment.csv");
  const MatX curvature = read_rows(folder / "test_image_expected_curvature.csv");
  LinePlot shapes, laws;
  shapes.title = "Profile of a cantilevered glass fabric";
  shapes.x = axis("x", "mm");
  shapes.y = axis("y", "mm");
  laws.title = "Moment and curvature";
  laws.x = axis("curvature", "1/m");
  laws.y = axis("moment per width", "N");
  laws.x.lower = 0;
  laws.x.upper = 30;
  laws.height = 460;
  PlotSeries published;
  published.name = "published";
  published.colour = 0;
  published.mark = PlotSeries::Mark::line_and_points;
  published.x = list(curvature.col(0));
  published.y = list(moment.col(0));
  laws.series.push_back(published);
  const MaterialPoints reference = published_profile(folder);
  const MaterialPoints photograph = photographed_profile(folder / "test_image.jpg");
  report_profile("published profile", reference, moment(0, 0), shapes, laws);
  report_profile("photograph", photograph, moment(0, 0), shapes, laws);
  const VecX apart = distances(reference, photograph);
  fmt::print("published profile to that of the photograph: rms {:.2f}, max {:.2f} mm\n",
             1e3 * rms(apart), 1e3 * apart.maxCoeff());
  write_plot(folders.out / "cantilever_profile.svg", shapes);
  write_plot(folders.out / "cantilever_moment.svg", laws);
}

void study_preform(const StudyFolders& folders) {
  for (const auto& [file, title, x, x_unit, y, y_unit] :
       {std::tuple{"moment_curv.csv", "Moment-curvature of a preform", "curvature", "1/m",
                   "moment per width", "N"},
        {"shear_stress_strain.csv", "Shear of a preform", "shear", "1", "stress", "MPa"}}) {
    const MatX rows = read_rows(folders.data / "preform" / file);
    const VecX strain = rows.col(0), stress = rows.col(1);
    LinePlot plot;
    plot.title = title;
    plot.x = axis(x, x_unit);
    plot.y = axis(y, y_unit);
    PlotSeries measured;
    measured.name = "measured";
    measured.colour = 0;
    measured.x = list(strain);
    measured.y = list(stress);
    plot.series.push_back(measured);
    fmt::print("{}: {} points to {:.4g} {}, {:.4g} {}\n", file, strain.size(), strain.maxCoeff(),
               x_unit, stress.maxCoeff(), y_unit);
    for (int knots = 1; knots <= 5; ++knots) {
      const TabulatedCurveFit fit = fit_tabulated_curve(strain, stress, knots);
      fmt::print("  {} control points: rms {:.2f} % of the largest;", knots, 100 * fit.relative);
      for (Eigen::Index k = 0; k < fit.curve.size(); ++k)
        fmt::print(" {:.4g} at {:.3g}", fit.curve.values()[k], fit.curve.knots()[k]);
      fmt::print("\n");
      PlotSeries series;
      series.name = fmt::format("{} control points, {:.1f} %", knots, 100 * fit.relative);
      series.x = list(strain);
      for (const double c : strain) series.y.push_back(fit.curve.respond(c).stress);
      if (knots != 2 && knots != 4) plot.series.push_back(series);
    }
    write_plot(folders.out / (std::string("preform_") +
                              (std::string(x) == "shear" ? "shear.svg" : "bend.svg")),
               plot);
  }
}

}  // namespace weft::validation
