#include "weft/report/mechanical_report.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "weft/optics/raster.h"

namespace weft {
namespace {

/// Of a cycle.
constexpr std::array<const char*, 3> kBranches{"from rest", "unloading", "loading"};

bool moves(const ReportClip& clip) {
  return std::ranges::any_of(clip.moved, [](double way) { return way != 0; });
}

/// Index of the clip with the longest way; 0 where none moves.
std::size_t driven_clip(const ReportMechanical& capture) {
  std::size_t found = 0;
  double most = 0;
  for (std::size_t i = 0; i < capture.clips.size(); ++i) {
    for (const double way : capture.clips[i].moved) {
      if (way <= most) continue;
      most = way;
      found = i;
    }
  }
  return found;
}

std::vector<double> scaled(std::vector<double> values, double factor) {
  for (double& value : values) value *= factor;
  return values;
}

PlotAxis axis(std::string_view label, std::string_view unit = "") {
  PlotAxis out;
  out.label = label;
  out.unit = unit;
  return out;
}

PlotSeries series(std::string name, std::vector<double> x, std::vector<double> y) {
  PlotSeries out;
  out.name = std::move(name);
  out.x = std::move(x);
  out.y = std::move(y);
  return out;
}

/// Two axes of the picture and the one towards the viewer.
struct ViewAxes {
  Vec3 right, up, towards;
};
ViewAxes view_axes(const ShapeView& view) {
  constexpr double kAbove = 0.5, kAside = 0.55;  // of the viewer, rad
  const Vec3 up = view.up.normalized();
  const Vec3 side = up.unitOrthogonal();
  const Vec3 front = std::cos(kAside) * side + std::sin(kAside) * up.cross(side);
  ViewAxes axes;
  axes.towards = std::cos(kAbove) * front + std::sin(kAbove) * up;
  axes.right = up.cross(axes.towards).normalized();
  axes.up = axes.towards.cross(axes.right);
  return axes;
}

/// The picture plane: px = origin + scale * coordinate.
struct Frame2 {
  double scale, left, top;
  int width, height;
};
Frame2 fit_frame(const ShapeView& view, const ViewAxes& axes) {
  Vec2 lower = Vec2::Constant(kInfinity), upper = -lower;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 p((corner & 1) ? view.upper.x() : view.lower.x(),
                 (corner & 2) ? view.upper.y() : view.lower.y(),
                 (corner & 4) ? view.upper.z() : view.lower.z());
    const Vec2 q(axes.right.dot(p), axes.up.dot(p));
    lower = lower.cwiseMin(q);
    upper = upper.cwiseMax(q);
  }
  constexpr double kMargin = 6;  // px
  const Vec2 size = (upper - lower).cwiseMax(1e-9);
  // At most as high as wide.
  const double scale = (view.width - 2 * kMargin) / std::max(size.x(), size.y());
  const int height = static_cast<int>(std::ceil(scale * size.y() + 2 * kMargin));
  const double spare = view.width - 2 * kMargin - scale * size.x();
  return {scale, kMargin + spare / 2 - scale * lower.x(), kMargin + scale * upper.y(), view.width,
          height};
}

Rgb shaded(Rgb colour, double light) {
  const auto dim = [&](std::uint8_t c) { return static_cast<std::uint8_t>(light * c); };
  return {dim(colour.red), dim(colour.green), dim(colour.blue)};
}

}  // namespace

LinePlot force_plot(const ReportMechanical& capture) {
  LinePlot plot;
  plot.title = "Force of the clips";
  const std::size_t driven = driven_clip(capture);
  const bool by_way = !capture.clips.empty() && moves(capture.clips[driven]);
  plot.x =
      by_way ? axis(fmt::format("way of {}", capture.clips[driven].name), "mm") : axis("frame");
  plot.x.integers = !by_way;
  plot.y = axis("force", "N");
  plot.y.from_zero = true;
  int colour = 1;
  for (const ReportClip& clip : capture.clips) {
    if (clip.measured.empty()) continue;
    std::vector<double> x = scaled(capture.clips[driven].moved, kMillimetres);
    if (!by_way)
      for (std::size_t k = 0; k < x.size(); ++k) x[k] = capture.frames[k].index;
    PlotSeries computed = series(fmt::format("{}, computed", clip.name), x, clip.computed);
    computed.colour = colour;
    computed.lower = clip.lower;
    computed.upper = clip.upper;
    PlotSeries measured = series(fmt::format("{}, measured", clip.name), x, clip.measured);
    measured.colour = colour++ % 7;
    measured.mark = PlotSeries::Mark::points;
    plot.series.push_back(std::move(computed));
    plot.series.push_back(std::move(measured));
  }
  return plot;
}

LinePlot loaded_plot(const ReportMechanical& capture) {
  LinePlot plot;
  plot.title = "Way of the clips under known forces";
  const bool by_force = std::ranges::any_of(capture.loaded, [](const ReportLoadedClip& clip) {
    return std::ranges::any_of(clip.force, [&](double f) { return f != clip.force.front(); });
  });
  plot.x = by_force ? axis("known force", "N") : axis("frame");
  plot.x.integers = !by_force;
  plot.y = axis("way", "mm");
  int colour = 1;
  for (const ReportLoadedClip& clip : capture.loaded) {
    std::vector<double> x = clip.force;
    if (!by_force)
      for (std::size_t k = 0; k < x.size(); ++k) x[k] = capture.frames[k].index;
    PlotSeries computed =
        series(fmt::format("{}, computed", clip.name), x, scaled(clip.computed, kMillimetres));
    computed.colour = colour;
    computed.lower = scaled(clip.lower, kMillimetres);
    computed.upper = scaled(clip.upper, kMillimetres);
    PlotSeries measured =
        series(fmt::format("{}, measured", clip.name), x, scaled(clip.measured, kMillimetres));
    measured.colour = colour++ % 7;
    measured.mark = PlotSeries::Mark::points;
    plot.series.push_back(std::move(computed));
    plot.series.push_back(std::move(measured));
  }
  return plot;
}

LinePlot shape_distance_plot(const ReportMechanical& capture) {
  LinePlot plot;
  plot.title = "Distance to the measured shape";
  plot.x = axis("frame");
  plot.x.integers = true;
  plot.y = axis("distance", "mm");
  plot.y.from_zero = true;
  PlotSeries mean, largest;
  for (const ReportMechanicalFrame& frame : capture.frames) {
    if (!frame.distance) continue;
    mean.x.push_back(frame.index);
    mean.y.push_back(kMillimetres * frame.distance->mean);
    largest.x.push_back(frame.index);
    largest.y.push_back(kMillimetres * frame.distance->max);
  }
  mean.name = "mean";
  mean.colour = 1;
  largest.name = "largest";
  largest.colour = 2;
  largest.dashed = true;
  for (PlotSeries* series : {&mean, &largest}) series->mark = PlotSeries::Mark::line_and_points;
  plot.series = {std::move(mean), std::move(largest)};
  return plot;
}

double ReportOverhang::mean() const {
  return std::accumulate(measured.begin(), measured.end(), 0.0) /
         static_cast<double>(measured.size());
}

LinePlot overhang_plot(const ReportOverhang& overhang, int width) {
  LinePlot plot;
  plot.width = width;
  plot.title = fmt::format("The strip at the mean of what was read, {:.4g} mm",
                           kMillimetres * overhang.mean());
  plot.x = axis("from the edge", "mm");
  plot.y = axis("height", "mm");
  plot.series.push_back(
      series("computed strip", scaled(overhang.x, kMillimetres), scaled(overhang.z, kMillimetres)));
  plot.series.back().colour = 1;
  // Beyond the tip by a tenth.
  const double end = 1.1 * kMillimetres *
                     std::max(overhang.x.back(), -overhang.z.back() / std::tan(overhang.angle));
  const double drop = std::max(end * std::tan(overhang.angle), -kMillimetres * overhang.z.back());
  plot.series.push_back(
      series(fmt::format("inclined plane, {:.4g}°", overhang.angle * 180 / std::numbers::pi),
             {0, end}, {0, -end * std::tan(overhang.angle)}));
  plot.series.back().colour = 0;
  plot.series.back().dashed = true;
  // What axes and title take of width and height, about.
  constexpr double kAside = 44, kAbove = 117;
  plot.y.lower = -1.05 * drop;
  plot.y.upper = 0.05 * drop;
  const double scale = (plot.height - kAbove) / (*plot.y.upper - *plot.y.lower);
  plot.x.lower = 0;
  plot.x.upper = std::max(end, (plot.width - kAside) / scale);
  return plot;
}

LinePlot strain_plot(const ReportHistogram& histogram) {
  LinePlot plot;
  plot.title = histogram.name;
  plot.height = 220;
  plot.x = histogram.unit.empty() ? axis("strain", "%") : axis("curvature", histogram.unit);
  plot.y = axis("share of the area", "%");
  plot.y.from_zero = true;
  PlotSeries series;
  series.colour = 1;
  const double factor = histogram.unit.empty() ? 100 : 1;
  const auto bins = static_cast<double>(histogram.share.size());
  // A staircase.
  for (std::size_t i = 0; i < histogram.share.size(); ++i) {
    for (const double edge : {0.0, 1.0}) {
      const double t = (static_cast<double>(i) + edge) / bins;
      series.x.push_back(factor * (histogram.lower + t * (histogram.upper - histogram.lower)));
      series.y.push_back(100 * histogram.share[i]);
    }
  }
  plot.series.push_back(std::move(series));
  return plot;
}

LinePlot response_plot(const ReportResponse& response) {
  LinePlot plot;
  plot.title = response.name;
  plot.height = 260;
  const bool bend = !response.strain_unit.empty();
  plot.x = bend ? axis("curvature", response.strain_unit) : axis("strain", "%");
  plot.y = axis(bend ? "moment per width" : "force per width", response.stress_unit);
  const std::vector<double> strain = scaled(response.strain, bend ? 1 : 100);
  std::vector<std::size_t> ends = response.turns;
  if (!strain.empty()) ends.push_back(strain.size() - 1);
  std::size_t first = 0;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const auto branch = [&](const std::vector<double>& values) {
      if (values.empty()) return values;
      const auto at = [&](std::size_t k) {
        return values.begin() + static_cast<std::ptrdiff_t>(k);
      };
      return std::vector<double>(at(first), at(ends[i] + 1));
    };
    PlotSeries curve = series(response.turns.empty() ? "" : kBranches[std::min<std::size_t>(i, 2)],
                              branch(strain), branch(response.stress));
    curve.colour = 1 + static_cast<int>(i);
    curve.dashed = !response.turns.empty() && i == 0;
    curve.lower = branch(response.lower);
    curve.upper = branch(response.upper);
    plot.series.push_back(std::move(curve));
    first = ends[i];
  }
  return plot;
}

Picture shape_picture(const TriangleMesh& mesh, const Points& x, const VecX& values, double full,
                      const ShapeView& view) {
  const ViewAxes axes = view_axes(view);
  const Frame2 frame = fit_frame(view, axes);
  Picture picture{frame.width, frame.height, {}};
  const auto pixels =
      static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height);
  picture.rgb.assign(3 * pixels, 255);
  std::vector<float> depth(pixels, -std::numeric_limits<float>::infinity());
  const auto project = [&](int vertex) {
    const Vec3 p = x.col(vertex);
    return ImagePoint{static_cast<float>(frame.left + frame.scale * axes.right.dot(p)),
                      static_cast<float>(frame.top - frame.scale * axes.up.dot(p))};
  };
  const auto value = [&](int vertex) {
    return values.size() > 0 ? static_cast<float>(values[vertex]) : 0.0f;
  };
  const auto height = [&](int vertex) {
    return static_cast<float>(axes.towards.dot(x.col(vertex)));
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    const ImagePoint pa = project(a), pb = project(b), pc = project(c);
    BarycentricGradient barycentric{};
    if (!barycentric.set(pa, pb, pc)) continue;
    const float first_height = height(a), first_value = value(a);
    const ImagePoint rise = barycentric.of(height(a), height(b), height(c));
    const ImagePoint slope = barycentric.of(value(a), value(b), value(c));
    const Vec3 normal = Vec3(x.col(b) - x.col(a)).cross(Vec3(x.col(c) - x.col(a))).normalized();
    const double light = 0.45 + 0.55 * std::abs(normal.dot(axes.towards));
    for_each_span(pa, pb, pc, frame.width, frame.height, [&](int row, int begin, int end) {
      for (int column = begin; column < end; ++column) {
        const float dx = static_cast<float>(column) + 0.5f - pa.x;
        const float dy = static_cast<float>(row) + 0.5f - pa.y;
        const auto at = static_cast<std::size_t>(row) * static_cast<std::size_t>(frame.width) +
                        static_cast<std::size_t>(column);
        const float z = first_height + rise.x * dx + rise.y * dy;
        if (z <= depth[at]) continue;
        depth[at] = z;
        const double v = static_cast<double>(first_value + slope.x * dx + slope.y * dy);
        const Rgb colour =
            shaded(values.size() > 0 ? colour_at(ColourMap::viridis, v / full) : Rgb{190, 194, 200},
                   light);
        picture.rgb[3 * at] = colour.red;
        picture.rgb[3 * at + 1] = colour.green;
        picture.rgb[3 * at + 2] = colour.blue;
      }
    });
  }
  return picture;
}

}  // namespace weft
