#include "weft/fabric/mujoco_cloth.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <string_view>

#include "weft/base/error.h"
#include "weft/fabric/exported_terms.h"

namespace weft {
namespace {

constexpr double kThickness = 1e-3;  // m, cancels
constexpr double kContactRadius = 1e-3;
constexpr double kShareOfStableStep = 0.5;
constexpr int kFewestCells = 2;

void check(const MujocoClothOptions& options) {
  require_positive("the spacing of a mesh", options.spacing, "m");
  require_positive("an areal density", options.areal_density, "kg/m^2");
  require_positive("the speed of drag", options.drag_speed, "m/s");
  if (!(options.hem_width >= 0 && std::isfinite(options.hem_width)))
    throw Error(fmt::format("a hem {} m wide, must be 0 at least", options.hem_width));
  for (const int cells : {options.columns, options.rows})
    if (cells < kFewestCells)
      throw Error(fmt::format("{} cells along a side, must be {} at least", cells, kFewestCells));
}

/// x with x - k^2 / x = uniaxial: of a square lattice with diagonals k, along the threads.
double threads_and_diagonals(double uniaxial, double k) {
  return (uniaxial + std::hypot(uniaxial, 2 * k)) / 2;
}

double rounded_down(double step) {
  const double unit = std::pow(10, std::floor(std::log10(step)) - 1);
  return std::floor(step / unit) * unit;
}

/// The flex that bends, in D.
constexpr double kAlongThreads = 2.5, kAtHalfRightAngle = 4, kStiffestMode = 288;
/// D of the stiffness or the damping in question, by its geometric mean over the two directions.
double modulus_of(double mean) { return mean / std::sqrt(kAlongThreads * kAtHalfRightAngle); }

double stable_step(const MujocoCloth& c, const MujocoClothOptions& o) {
  const double h2 = o.spacing * o.spacing, mass = o.areal_density * h2;
  const double bend = kStiffestMode * modulus_of(c.bend_stiffness) / h2;
  const double w2 = (4 * (c.thread_stiffness + c.shear_stiffness + c.taut_stiffness) + bend) / mass;
  const double damping =
      (4 * (c.thread_damping + c.shear_damping + c.taut_damping) + bend * c.bend_damping) / mass;
  return (std::hypot(damping, 2 * std::sqrt(w2)) - damping) / w2;
}

void note_bend(const Fabric& fabric, const MujocoCloth& cloth, std::vector<std::string>& lost) {
  const double along = fabric.value("bend_stiffness");
  const double modulus = modulus_of(cloth.bend_stiffness);
  lost.push_back(fmt::format(
      "Bend is {:.3g} N m along the threads and {:.3g} at 45 degrees; the fabric has {:.3g} and "
      "{:.3g}.",
      kAlongThreads * modulus, kAtHalfRightAngle * modulus, along, (along + twist_of(fabric)) / 2));
}

void note_diagonals(const MujocoCloth& cloth, std::vector<std::string>& lost) {
  const double narrowing = cloth.shear_stiffness / (cloth.thread_stiffness + cloth.shear_stiffness);
  if (narrowing > kWorthSaying)
    lost.push_back(fmt::format(
        "Shear is resisted by diagonals, which couple weft and warp: stretched along one, the "
        "cloth narrows along the other by {:.2g} of the strain.",
        narrowing));
  if (cloth.taut_damping > 0)
    lost.emplace_back(
        "The diagonals' damping acts in slack diagonals, too, along which the fabric has none.");
}

/// A vertex of the grid.
struct Node {
  int column, row;
  auto operator<=>(const Node&) const = default;
};

std::string name_of(const Node& n) { return fmt::format("cloth_{}_{}", n.column, n.row); }

/// A flex: its vertices in the order in which they come, its elements as places among them.
class FlexText {
 public:
  /// Of a vertex, which gets the next one where it has none.
  std::size_t place(const Node& node) {
    const auto [at, is_new] = places_.emplace(node, places_.size());
    if (is_new) fmt::format_to(std::back_inserter(bodies_), "{} ", name_of(node));
    return at->second;
  }
  template <std::size_t N>
  void add(const std::array<Node, N>& element) {
    for (const Node& node : element)
      fmt::format_to(std::back_inserter(elements_), "{} ", place(node));
  }
  std::string xml(std::string_view name, int dimension, const std::string& inside) const {
    return fmt::format(
        "    <flex name=\"{}\" dim=\"{}\" radius=\"{:g}\" body=\"{}\" element=\"{}\"{}</flex>\n",
        name, dimension, kContactRadius, bodies_, elements_, inside);
  }

 private:
  std::map<Node, std::size_t> places_;
  std::string bodies_, elements_;
};

class ModelText {
 public:
  ModelText(const MujocoCloth& cloth, const MujocoClothOptions& options)
      : cloth_(cloth), options_(options) {}

  std::string bodies() const;
  std::string flexes() const;
  std::string tendons() const;

 private:
  bool is_held(const Node& n) const;
  bool is_there(const Node& n) const {
    return n.column >= 0 && n.column <= options_.columns && n.row >= 0 && n.row <= options_.rows;
  }
  bool is_side(const Node& n) const { return n.column == 0 || n.column == options_.columns; }
  bool is_end(const Node& n) const { return n.row == 0 || n.row == options_.rows; }
  /// Of a vertex, kg.
  double mass(const Node& n) const {
    const double hem = is_side(n) || is_end(n) ? options_.hem_width / options_.spacing : 0;
    return options_.areal_density * options_.spacing * options_.spacing * (area(n) + hem);
  }
  /// Of a vertex, in cells.
  double area(const Node& n) const { return (is_side(n) ? 0.5 : 1) * (is_end(n) ? 0.5 : 1); }
  /// Even rows of even columns, then those that are even in one, then in none, so that the vertex
  /// at a triangle's right angle has its place between the others'. MuJoCo 3.14 compiles the
  /// stencil of an edge for its ends as its first triangle has them and applies it to them by
  /// their places: only where both orders agree, or at a diagonal, is there no force at rest.
  template <class Each>
  void each_node(Each each) const {
    for (const int odd : {0, 1, 2})
      for (int row = 0; row <= options_.rows; ++row)
        for (int column = 0; column <= options_.columns; ++column)
          if (row % 2 + column % 2 == odd) each(Node{column, row});
  }
  template <class Each>
  void each_cell(Each each) const {
    for (int row = 0; row < options_.rows; ++row)
      for (int column = 0; column < options_.columns; ++column) each(Node{column, row});
  }
  std::string surface() const;
  std::string threads() const;
  std::string diagonals() const;

  const MujocoCloth& cloth_;
  const MujocoClothOptions& options_;
};

constexpr std::string_view kUnseen =
    " group=\"5\"><contact contype=\"0\" conaffinity=\"0\" selfcollide=\"none\"/>";

std::string springs(double stiffness, double damping) {
  return fmt::format("{}<edge stiffness=\"{:.9g}\" damping=\"{:.9g}\"/>", kUnseen, stiffness,
                     damping);
}

bool ModelText::is_held(const Node& n) const {
  if (n.row != 0 || options_.held == MujocoHold::none) return false;
  return options_.held == MujocoHold::edge || n.column == 0 || n.column == options_.columns;
}

std::string ModelText::bodies() const {
  std::string text;
  const double cell = options_.spacing * options_.spacing;
  each_node([&](const Node& n) {
    const auto out = std::back_inserter(text);
    fmt::format_to(out, "    <body name=\"{}\" pos=\"{:.9g} 0 {:.9g}\"", name_of(n),
                   n.column * options_.spacing, -n.row * options_.spacing);
    // A body of mocap has no mass; a site is what tendons go to.
    const std::string_view site = "<site size=\"1e-4\" group=\"5\" name=\"at_";
    const std::string sites =
        cloth_.taut_stiffness > 0 ? fmt::format("{}{}\"/>", site, name_of(n)) : "";
    if (is_held(n)) {
      fmt::format_to(out, " mocap=\"true\">{}</body>\n", sites);
      return;
    }
    const double inertia = mass(n) * cell;
    fmt::format_to(
        out, "><inertial pos=\"0 0 0\" mass=\"{:.9g}\" diaginertia=\"{:.9g} {:.9g} {:.9g}\"/>",
        mass(n), inertia, inertia, inertia);
    for (const std::string_view axis : {"1 0 0", "0 1 0", "0 0 1"})
      fmt::format_to(out, "<joint type=\"slide\" axis=\"{}\" damping=\"{:.9g}\"/>", axis,
                     cloth_.drag * cell * area(n));
    fmt::format_to(out, "{}</body>\n", sites);
  });
  return text;
}

/// Whether the order of a triangle's vertices is that of its front, which faces -y.
bool is_in_front(const Node& a, const Node& b, const Node& c) {
  return (b.column - a.column) * (c.row - a.row) - (b.row - a.row) * (c.column - a.column) < 0;
}

std::string ModelText::surface() const {
  FlexText flex;
  each_node([&](const Node& n) { flex.place(n); });
  // All with one side in front. Of the two triangles at a thread one has its ends in the order of
  // their places: those come first, so that stencils are compiled for that order (each_node).
  for (const bool in_order : {true, false})
    each_cell([&](const Node& p) {
      const Node right{p.column + 1, p.row}, below{p.column, p.row + 1};
      const Node across{p.column + 1, p.row + 1};
      // The diagonal goes from the vertex that is even in both to the one that is odd in both.
      const bool falls = (p.row + p.column) % 2 == 0, from_upper = p.row % 2 == 0;
      const Node upper = falls ? p : right, lower = falls ? across : below;
      const Node first = from_upper ? upper : lower, last = from_upper ? lower : upper;
      for (const Node& square : {falls ? right : p, falls ? below : across}) {
        if (is_in_front(first, square, last) != in_order) continue;
        flex.add(in_order ? std::array{first, square, last} : std::array{first, last, square});
      }
    });
  const double young = 48 * modulus_of(cloth_.bend_stiffness) / std::pow(kThickness, 3);
  return flex.xml("cloth", 2,
                  fmt::format(" rgba=\".55 .6 .75 1\"><contact selfcollide=\"none\"/>"
                              "<elasticity elastic2d=\"bend\" young=\"{:.9g}\" poisson=\"0\" "
                              "thickness=\"{:g}\" damping=\"{:.9g}\"/>",
                              young, kThickness, cloth_.bend_damping));
}

std::string ModelText::threads() const {
  FlexText inner, rim;
  each_node([&](const Node& n) {
    const Node right{n.column + 1, n.row}, below{n.column, n.row + 1};
    if (is_there(right)) (is_end(n) ? rim : inner).add(std::array{n, right});
    if (is_there(below)) (is_side(n) ? rim : inner).add(std::array{n, below});
  });
  const double of_rim = 0.5 + options_.hem_width / options_.spacing;
  return inner.xml("threads", 1, springs(cloth_.thread_stiffness, cloth_.thread_damping)) +
         rim.xml("rim", 1,
                 springs(of_rim * cloth_.thread_stiffness, of_rim * cloth_.thread_damping));
}

std::string ModelText::diagonals() const {
  FlexText flex;
  each_cell([&](const Node& p) {
    flex.add(std::array{p, Node{p.column + 1, p.row + 1}});
    flex.add(std::array{Node{p.column + 1, p.row}, Node{p.column, p.row + 1}});
  });
  return flex.xml("diagonals", 1, springs(cloth_.shear_stiffness, cloth_.shear_damping));
}

std::string ModelText::flexes() const { return surface() + threads() + diagonals(); }

std::string ModelText::tendons() const {
  if (cloth_.taut_stiffness == 0) return {};
  std::string text = "  <tendon>\n";
  const double length = std::sqrt(2.0) * options_.spacing;
  const auto add = [&](const Node& from, const Node& to) {
    fmt::format_to(std::back_inserter(text),
                   "    <spatial group=\"5\" stiffness=\"{:.9g}\" damping=\"{:.9g}\" "
                   "springlength=\"0 {:.9g}\">"
                   "<site site=\"at_{}\"/><site site=\"at_{}\"/></spatial>\n",
                   cloth_.taut_stiffness, cloth_.taut_damping, length, name_of(from), name_of(to));
  };
  each_cell([&](const Node& p) {
    add(p, {p.column + 1, p.row + 1});
    add({p.column + 1, p.row}, {p.column, p.row + 1});
  });
  return text + "  </tendon>\n";
}

std::string xml_text(std::string_view text) {
  std::string escaped;
  for (const char c : text) switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  return escaped;
}

}  // namespace

MujocoCloth mujoco_cloth(const Fabric& fabric, const MujocoClothOptions& options) {
  require_motion_model(fabric);
  check(options);
  MujocoCloth cloth;
  cloth.drag = linear_drag(fabric, options.drag_speed, cloth.lost);
  cloth.shear_stiffness = fabric.value("shear_stiffness");
  cloth.shear_damping = fabric.value("shear_damping");
  cloth.thread_stiffness =
      threads_and_diagonals(fabric.value("stretch_stiffness"), cloth.shear_stiffness) -
      cloth.shear_stiffness;
  cloth.thread_damping =
      threads_and_diagonals(fabric.value("stretch_damping"), cloth.shear_damping) -
      cloth.shear_damping;
  cloth.taut_stiffness = value_or_none(fabric, "diagonal_stiffness") / 2;
  cloth.taut_damping = value_or_none(fabric, "diagonal_damping") / 2;
  const double along = fabric.value("bend_stiffness");
  cloth.bend_stiffness = std::sqrt(along * (along + twist_of(fabric)) / 2);
  cloth.bend_damping = fabric.value("bend_damping") / along;
  cloth.timestep = rounded_down(kShareOfStableStep * stable_step(cloth, options));
  note_bend(fabric, cloth, cloth.lost);
  note_diagonals(cloth, cloth.lost);
  return cloth;
}

std::vector<std::pair<std::string, double>> settings_of(const MujocoCloth& cloth) {
  return {{"thread_stiffness", cloth.thread_stiffness},
          {"thread_damping", cloth.thread_damping},
          {"shear_stiffness", cloth.shear_stiffness},
          {"shear_damping", cloth.shear_damping},
          {"taut_stiffness", cloth.taut_stiffness},
          {"taut_damping", cloth.taut_damping},
          {"bend_stiffness", cloth.bend_stiffness},
          {"bend_damping", cloth.bend_damping},
          {"drag", cloth.drag},
          {"timestep", cloth.timestep}};
}

std::string mujoco_model(const Fabric& fabric, const MujocoCloth& cloth,
                         const MujocoClothOptions& options) {
  std::string lost;
  for (const std::string& sentence : cloth.lost) lost += fmt::format("  - {}\n", sentence);
  const ModelText text(cloth, options);
  return fmt::format(
      R"xml(<!-- A fabric that weft estimated, {columns} x {rows} cells of {spacing:g} m. The numbers hold for these cells: export again
  for others. The pose of this file is its shape at rest. Bodies move on slides; those of mocap go where d.mocap_pos says.
  A longer time step than this one may be unstable; what the model cannot express:
{lost}-->
<mujoco model="{name}">
  <option timestep="{timestep:.9g}" integrator="Euler"/>
  <worldbody>
{bodies}  </worldbody>
  <deformable>
{flexes}  </deformable>
{tendons}</mujoco>
)xml",
      fmt::arg("columns", options.columns), fmt::arg("rows", options.rows),
      fmt::arg("spacing", options.spacing), fmt::arg("lost", lost),
      fmt::arg("name", xml_text(fabric.name)), fmt::arg("timestep", cloth.timestep),
      fmt::arg("bodies", text.bodies()), fmt::arg("flexes", text.flexes()),
      fmt::arg("tendons", text.tendons()));
}

}  // namespace weft
