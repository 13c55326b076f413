#include "weft/estimate/component_strains.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "weft/base/error.h"
#include "weft/model/elastic_model.h"
#include "weft/model/sheet_model.h"
#include "weft/model/spring_model.h"

namespace weft {
namespace {

constexpr std::array<std::string_view, 6> kThreads{"weft_stretch", "warp_stretch", "shear",
                                                   "weft_bend",    "warp_bend",    "diagonal_bend"};
constexpr std::array<std::string_view, 6> kStvk{"membrane_uu", "membrane_vv", "membrane_shear",
                                                "bend_uu",     "bend_vv",     "bend_twist"};
constexpr int kStretches = 2;  // the first components, whose sign matters

int component_of(const Fabric& fabric, std::string_view row) {
  const auto& names = fabric.model == "stvk" ? kStvk : kThreads;
  const auto found = std::find(names.begin(), names.end(), row);
  const bool known = fabric.model == "stvk" || fabric.model == "stvk-diagonal" ||
                     fabric.model == "soft-constraints" || fabric.model == "springs";
  if (!known || found == names.end())
    throw Error(fmt::format("\"{}\" of model \"{}\" is no strain component", row, fabric.model));
  return static_cast<int>(found - names.begin());
}

std::vector<char> held_vertices(const MechanicalTrial& trial, const MechanicalFrame& frame,
                                const TriangleMesh& mesh) {
  std::vector<char> held;
  for (const int clip : clip_of_vertices(mesh, trial.capture.clips(frame.frame)))
    held.push_back(clip >= 0 ? 1 : 0);
  return held;
}

void add_springs(const MechanicalTrial& trial, const MechanicalFrame& frame,
                 const TriangleMesh& mesh, const Fabric& fabric, int component,
                 ComponentSample& sample) {
  const detail::SpringModel model(mesh, fabric, trial.capture.grain_angle);
  const std::vector<char> held = held_vertices(trial, frame, mesh);
  for (const auto& spring : model.springs()) {
    if (spring.component != component || (held[at(spring.a)] && held[at(spring.b)])) continue;
    const double length = (frame.x.col(spring.b) - frame.x.col(spring.a)).norm();
    sample.strains.push_back(length / spring.length - 1);
    sample.areas.push_back(spring.area);
  }
}

void add_elements(const MechanicalTrial& trial, const MechanicalFrame& frame,
                  const TriangleMesh& mesh, const Fabric& fabric, int component,
                  ComponentSample& sample) {
  const auto model = make_elastic_model(mesh, fabric, trial.capture.grain_angle);
  const auto& sheet = dynamic_cast<const detail::SheetModel&>(*model);  // all but springs
  const std::vector<char> held = held_vertices(trial, frame, mesh);
  const bool relative = fabric.model == "soft-constraints" && component < kStretches;
  for (const detail::SheetModel::ElementStrain& element :
       sheet.element_strains(frame.x, component)) {
    const auto& v = element.vertices;
    if (held[at(v[0])] && held[at(v[1])] && held[at(v[2])]) continue;
    double strain = element.strain;
    if (relative) strain = std::sqrt(std::max(0.0, 1 + 2 * strain)) - 1;
    sample.strains.push_back(component < kStretches ? strain : std::abs(strain));
    sample.areas.push_back(element.area);
  }
}

}  // namespace

ComponentSample component_strains(const MechanicalTrial& trial,
                                  const std::vector<MechanicalFrame>& frames, const Fabric& fabric,
                                  std::string_view row) {
  const int component = component_of(fabric, row);
  ComponentSample sample;
  for (const MechanicalFrame& frame : frames) {
    const TriangleMesh& mesh = trial.stages[at(trial.stage_of_frame[at(frame.frame)])].mesh;
    if (fabric.model == "springs")
      add_springs(trial, frame, mesh, fabric, component, sample);
    else
      add_elements(trial, frame, mesh, fabric, component, sample);
  }
  return sample;
}

void append(const ComponentSample& more, ComponentSample& sample) {
  sample.strains.insert(sample.strains.end(), more.strains.begin(), more.strains.end());
  sample.areas.insert(sample.areas.end(), more.areas.begin(), more.areas.end());
}

StrainRange strain_range(const ComponentSample& sample, double outliers) {
  if (sample.strains.empty()) throw Error("no strains to take the range of");
  std::vector<std::size_t> order(sample.strains.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return sample.strains[a] < sample.strains[b]; });
  const double all = std::accumulate(sample.areas.begin(), sample.areas.end(), 0.0);
  StrainRange range{sample.strains[order.front()], sample.strains[order.back()]};
  double below = 0;
  for (const std::size_t i : order) {
    if (below <= outliers * all) range.lower = sample.strains[i];
    if (below <= (1 - outliers) * all) range.upper = sample.strains[i];
    below += sample.areas[i];
  }
  return range;
}

}  // namespace weft
