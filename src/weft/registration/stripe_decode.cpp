#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <queue>

#include "weft/base/error.h"
#include "weft/registration/stripe_edges.h"
#include "weft/registration/stripe_surface.h"

namespace weft {
namespace {

// Depth noise of one edge, m: 0.2 px at the shallowest usual angle between camera and projector.
constexpr double depth_noise = 2e-3;
// Slope of the surface, change of depth along the view over distance across it: up to the first,
// two edges are taken to be neighbours on one smooth piece; beyond the second, none are.
constexpr double smooth_slope = 1.5;
// Stripe periods around a fixture in which its depth decides about the index.
constexpr double anchor_periods = 2.5;
// Fewest edges of a piece, and least support by its neighbours, in edges that join it smoothly.
constexpr int least_piece = 8;
constexpr double least_votes = 2;

/// An edge and, once it is known, where it lies.
struct Node {
  StripeEdge edge;
  Vec3 direction;  ///< of the camera ray, scaled to unit depth
  int piece = -1;
  bool known = false;
  double row = 0;    ///< projector row, px; up to the shift of its piece until that is known
  double depth = 0;  ///< camera depth, m
};

/// Camera rays against the projector's planes of light.
class LightPlanes {
 public:
  LightPlanes(const Rig& rig, const Vec3& reference) : rig_(&rig) {
    const Vec3 pixel = rig.camera.project(reference);
    const Vec3 below = rig.camera.unproject({pixel.x(), pixel.y() + 1}, pixel.z());
    const double rows = rig.projector.project(below).y() - rig.projector.project(reference).y();
    upright_ = rows > 0;
    image_period_ = rig.pattern.period / std::max(std::abs(rows), 1e-9);
  }

  /// Stripe period in the image, px, at the depth of the reference point.
  double image_period() const { return image_period_; }

  /// True if the projector's rows run the image's way.
  bool upright() const { return upright_; }

  Vec3 direction(const Vec2& pixel) const {
    return rig_->camera.unproject(pixel, 1.0) - rig_->camera.center();
  }

  Vec3 point(const Vec3& direction, double depth) const {
    return rig_->camera.center() + depth * direction;
  }

  double row(const Vec3& direction, double depth) const {
    return rig_->projector.project(point(direction, depth)).y();
  }

  /// Depth at which the ray meets the plane of projector row `row`; NaN if it does not in front.
  double depth(const Vec3& direction, double row) const {
    const Projection& p = rig_->projector.projection();
    const Eigen::RowVector4d plane = p.row(1) - row * p.row(2);
    const double along = plane.head<3>().dot(direction);
    const double offset = plane.head<3>().dot(rig_->camera.center()) + plane(3);
    const double depth = -offset / along;
    return depth > 0 ? depth : std::nan("");
  }

  /// Row of the stripe edge of this kind that is nearest to the ray's row at `depth`. Edges from
  /// dark to bright lie at whole periods, from bright to dark half a period on.
  double edge_row(const Node& node, double depth) const {
    const double period = rig_->pattern.period;
    const double offset = node.edge.rising == upright_ ? 0.0 : 0.5;
    return period * (std::round(row(node.direction, depth) / period - offset) + offset);
  }

  bool inside(const Vec3& point) const {
    if (rig_->projector_width <= 0 || rig_->projector_height <= 0) return true;
    const Vec3 p = rig_->projector.project(point);
    return p.x() >= 0 && p.x() <= rig_->projector_width && p.y() >= 0 &&
           p.y() <= rig_->projector_height;
  }

 private:
  const Rig* rig_;
  bool upright_ = true;
  double image_period_ = 0;
};

/// Which points the cloth can reach: a point of the fabric is nowhere further from a fixture than
/// on the undeformed fabric, but for stretch.
class Reach {
 public:
  explicit Reach(const Scene& scene) : scene_(&scene) {
    for (const PointFixture& fixture : scene.fixtures) {
      positions_.push_back(fixture.motion.position(scene.frame_times.front()));
    }
  }
  const std::vector<Vec3>& fixtures() const { return positions_; }

  bool contains(const Vec3& point) const {
    constexpr double stretched = 1.1, slack = 0.02;
    for (int v = 0; v < scene_->mesh.vertex_count(); ++v) {
      bool reached = true;
      for (std::size_t f = 0; f < positions_.size() && reached; ++f) {
        const Vec2 at = scene_->mesh.material.col(scene_->fixtures[f].vertex);
        reached = (point - positions_[f]).norm() <=
                  stretched * (scene_->mesh.material.col(v) - at).norm() + slack;
      }
      if (reached) return true;
    }
    return false;
  }

 private:
  const Scene* scene_;
  std::vector<Vec3> positions_;
};

/// Finds the index of every edge: edges are joined into smooth pieces, in which indices follow from
/// one to the next, and the pieces are shifted by whole periods so that they fit the fixtures and
/// each other.
class StripeIndexer {
 public:
  StripeIndexer(const LightPlanes& planes, const Reach& reach, std::vector<Node>& nodes,
                int columns, double period, double steepest_slope)
      : planes_(planes),
        reach_(reach),
        nodes_(nodes),
        period_(period),
        steepest_slope_(steepest_slope) {
    first_.assign(static_cast<std::size_t>(columns) + 1, 0);
    for (const Node& node : nodes) ++first_[static_cast<std::size_t>(node.edge.column) + 1];
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
  }

  void run(const Rig& rig, double reference_depth) {
    split_into_pieces(reference_depth);
    collect_votes();
    vote_of_fixtures(rig);
    place_pieces();
  }

 private:
  /// Votes for the shift of a piece against another, in periods.
  using Votes = std::map<int, double>;

  struct Step {
    double cost;
    std::size_t node;
    double row;
    // Ties go to the lower node, so that the order never depends on the queue.
    bool operator<(const Step& other) const {
      return cost > other.cost || (cost == other.cost && node > other.node);
    }
  };

  double slope(const Node& to, double row, const Vec3& direction, double depth) const;

  struct Span {
    double top, bottom;  ///< y, px
  };
  Span span(std::size_t k) const;
  bool connected(std::size_t k, std::size_t n) const;
  template <class Visit>
  void for_neighbours(std::size_t k, Visit&& visit) const;

  void split_into_pieces(double reference_depth);
  void collect_votes();
  void vote_of_fixtures(const Rig& rig);
  void place_pieces();
  bool place(std::size_t piece, int shift);

  const LightPlanes& planes_;
  const Reach& reach_;
  std::vector<Node>& nodes_;
  double period_, steepest_slope_;
  std::vector<std::size_t> first_;                ///< of each column's nodes
  std::vector<std::vector<std::size_t>> pieces_;  ///< nodes of each
  std::vector<std::map<int, Votes>> links_;       ///< [piece][other piece]
  std::vector<Votes> votes_;                      ///< of each piece, by what is placed
};

/// Slope of the surface between a point at `depth` on the ray `direction` and an edge, if that is
/// the edge at projector row `row`; infinite if its ray does not meet that plane.
double StripeIndexer::slope(const Node& to, double row, const Vec3& direction, double depth) const {
  const double jump = std::abs(planes_.depth(to.direction, row) - depth);
  if (std::isnan(jump)) return kInfinity;
  const double lateral = depth * (to.direction - direction).norm();
  return std::max(jump - depth_noise, 0.0) / lateral;
}

/// The rows between which a stripe's bright and dark sides reach around edge k: up to the edges
/// above and below it, half a period where there is none.
StripeIndexer::Span StripeIndexer::span(std::size_t k) const {
  const StripeEdge& edge = nodes_[k].edge;
  const double reach = 0.5 * planes_.image_period();
  Span span{edge.y - reach, edge.y + reach};
  if (k > 0 && nodes_[k - 1].edge.column == edge.column) span.top = nodes_[k - 1].edge.y;
  if (k + 1 < nodes_.size() && nodes_[k + 1].edge.column == edge.column) {
    span.bottom = nodes_[k + 1].edge.y;
  }
  return span;
}

/// True if two edges of one kind on adjacent columns lie on one contour: the light above them is
/// connected, and so is the light below.
bool StripeIndexer::connected(std::size_t k, std::size_t n) const {
  const double y = nodes_[k].edge.y, other = nodes_[n].edge.y;
  const Span a = span(k), b = span(n);
  return std::max(a.top, b.top) < std::min(y, other) &&
         std::max(y, other) < std::min(a.bottom, b.bottom);
}

/// Calls visit(n) for the edges next to edge k: on its contour on the columns beside it, and the
/// next two above and below, so that one missed edge does not end a piece.
template <class Visit>
void StripeIndexer::for_neighbours(std::size_t k, Visit&& visit) const {
  const StripeEdge& edge = nodes_[k].edge;
  const int columns = static_cast<int>(first_.size()) - 1;
  for (const int side : {-1, 1}) {
    bool found = false;
    // A gap in a contour is crossed only where the stripe runs level.
    for (int step = 1; step <= 3 && !found; ++step) {
      const int c = edge.column + side * step;
      if (c < 0 || c >= columns) break;
      const auto end = first_[static_cast<std::size_t>(c) + 1];
      for (auto n = first_[static_cast<std::size_t>(c)]; n < end; ++n) {
        const StripeEdge& other = nodes_[n].edge;
        if (other.rising != edge.rising) continue;
        if (step == 1 ? !connected(k, n) : std::abs(other.y - edge.y) > 0.7 * step) continue;
        visit(n, 0.0);
        found = true;
      }
    }
  }
  const auto visit_vertical = [&](std::size_t n, double rows) {
    if (nodes_[n].edge.column == edge.column && nodes_[n].edge.rising != edge.rising)
      visit(n, rows);
  };
  const double half = planes_.upright() ? 0.5 * period_ : -0.5 * period_;
  if (k > 0) visit_vertical(k - 1, -half);
  if (k + 1 < nodes_.size()) visit_vertical(k + 1, half);
}

void StripeIndexer::split_into_pieces(double reference_depth) {
  std::priority_queue<Step> queue;
  for (std::size_t seed = 0; seed < nodes_.size(); ++seed) {
    if (nodes_[seed].piece >= 0) continue;
    const int piece = static_cast<int>(pieces_.size());
    pieces_.emplace_back();
    queue.push({0, seed, planes_.edge_row(nodes_[seed], reference_depth)});
    while (!queue.empty()) {
      const Step step = queue.top();
      queue.pop();
      Node& node = nodes_[step.node];
      if (node.piece >= 0) continue;
      node.piece = piece;
      node.row = step.row;
      node.depth = planes_.depth(node.direction, step.row);
      pieces_.back().push_back(step.node);
      for_neighbours(step.node, [&](std::size_t n, double rows) {
        if (nodes_[n].piece >= 0) return;
        const double row = node.row + rows;
        const double cost = slope(nodes_[n], row, node.direction, node.depth);
        if (cost <= smooth_slope) queue.push({cost, n, row});
      });
    }
  }
}

void StripeIndexer::collect_votes() {
  links_.resize(pieces_.size());
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const Node& node = nodes_[k];
    for_neighbours(k, [&](std::size_t n, double rows) {
      const Node& other = nodes_[n];
      if (other.piece == node.piece) return;
      const double steepness = slope(other, node.row + rows, node.direction, node.depth);
      if (steepness > steepest_slope_) return;
      const int shift = static_cast<int>(std::lround((node.row + rows - other.row) / period_));
      links_[static_cast<std::size_t>(node.piece)][other.piece][shift] +=
          1 / (1 + steepness * steepness);
    });
  }
}

void StripeIndexer::vote_of_fixtures(const Rig& rig) {
  votes_.resize(pieces_.size());
  const double radius = anchor_periods * planes_.image_period();
  for (const Vec3& fixture : reach_.fixtures()) {
    const Vec3 pixel = rig.camera.project(fixture);
    if (pixel.z() <= 0) continue;
    const Vec3 direction = planes_.direction(pixel.head<2>());
    for (const Node& node : nodes_) {
      const double distance =
          std::hypot(node.edge.column + 0.5 - pixel.x(), node.edge.y - pixel.y());
      if (distance > radius || distance < 1) continue;
      const double row = planes_.edge_row(node, pixel.z());
      const double steepness = slope(node, row, direction, pixel.z());
      if (steepness > steepest_slope_) continue;
      const int shift = static_cast<int>(std::lround((row - node.row) / period_));
      votes_[static_cast<std::size_t>(node.piece)][shift] += 1 / (1 + steepness * steepness);
    }
  }
}

/// The piece with the most votes for one shift goes first; its neighbours get its votes.
void StripeIndexer::place_pieces() {
  std::vector<char> done(pieces_.size(), 0);
  for (;;) {
    double most = least_votes;
    std::size_t best = pieces_.size();
    int best_shift = 0;
    for (std::size_t p = 0; p < pieces_.size(); ++p) {
      if (done[p]) continue;
      for (const auto& [shift, votes] : votes_[p]) {
        if (votes <= most) continue;
        most = votes;
        best = p;
        best_shift = shift;
      }
    }
    if (best == pieces_.size()) return;
    if (!place(best, best_shift)) {
      votes_[best].erase(best_shift);
      continue;
    }
    done[best] = 1;
    for (const auto& [other, link] : links_[best]) {
      for (const auto& [shift, votes] : link) {
        votes_[static_cast<std::size_t>(other)][shift + best_shift] += votes;
      }
    }
  }
}

/// False, and nothing done, if most of the piece would be where the cloth or the light cannot be.
bool StripeIndexer::place(std::size_t piece, int shift) {
  const auto depth_of = [&](const Node& node) {
    return planes_.depth(node.direction, node.row + shift * period_);
  };
  std::size_t possible = 0;
  for (const std::size_t k : pieces_[piece]) {
    const Vec3 point = planes_.point(nodes_[k].direction, depth_of(nodes_[k]));
    if (point.allFinite() && planes_.inside(point) && reach_.contains(point)) ++possible;
  }
  if (2 * possible < pieces_[piece].size()) return false;
  for (const std::size_t k : pieces_[piece]) {
    Node& node = nodes_[k];
    const double depth = depth_of(node);
    const Vec3 point = planes_.point(node.direction, depth);
    if (!point.allFinite()) continue;
    node.row += shift * period_;
    node.depth = depth;
    node.known = static_cast<int>(pieces_[piece].size()) >= least_piece && planes_.inside(point) &&
                 reach_.contains(point);
  }
  return true;
}

/// Reads the edges as nodes with their camera rays.
std::vector<Node> make_nodes(const std::vector<StripeEdge>& edges, const LightPlanes& planes) {
  std::vector<Node> nodes(edges.size());
  for (std::size_t k = 0; k < edges.size(); ++k) {
    nodes[k].edge = edges[k];
    nodes[k].direction = planes.direction({edges[k].column + 0.5, edges[k].y});
  }
  return nodes;
}

/// Depth at the pixel centres between edges half a period apart on a column: the projector row,
/// interpolated linearly, gives the plane that the pixel's ray meets.
void fill_depth(const std::vector<Node>& nodes, const LightPlanes& planes, double period,
                Image& depth) {
  const Node* above = nullptr;
  for (const Node& node : nodes) {
    if (!node.known) continue;
    if (above && above->edge.column == node.edge.column &&
        std::abs(std::abs(node.row - above->row) - 0.5 * period) < 1e-6 * period) {
      const int first = static_cast<int>(std::ceil(above->edge.y - 0.5));
      const int last = static_cast<int>(std::floor(node.edge.y - 0.5));
      for (int y = first; y <= last; ++y) {
        const double t = (y + 0.5 - above->edge.y) / (node.edge.y - above->edge.y);
        const Vec3 direction = planes.direction({node.edge.column + 0.5, y + 0.5});
        depth(y, node.edge.column) =
            static_cast<float>(planes.depth(direction, (1 - t) * above->row + t * node.row));
      }
    }
    above = &node;
  }
}

}  // namespace

StripePoints decode_stripes(const Image& intensity, const Mask& silhouette, const Rig& rig,
                            const Scene& scene, const StripeDecodeOptions& options) {
  if (silhouette.rows() != intensity.rows() || silhouette.cols() != intensity.cols()) {
    throw Error(fmt::format("stripes: the silhouette has {} x {} pixels, the frame {} x {}",
                            silhouette.cols(), silhouette.rows(), intensity.cols(),
                            intensity.rows()));
  }
  StripePoints result;
  result.depth = Image::Zero(intensity.rows(), intensity.cols());
  const Reach reach(scene);
  if (reach.fixtures().empty()) return result;
  Vec3 center = Vec3::Zero();
  for (const Vec3& fixture : reach.fixtures()) {
    center += fixture / static_cast<double>(reach.fixtures().size());
  }
  const LightPlanes planes(rig, center);
  const std::vector<StripeEdge> edges =
      find_stripe_edges(intensity, silhouette, planes.image_period());
  std::vector<Node> nodes = make_nodes(edges, planes);
  StripeIndexer indexer(planes, reach, nodes, static_cast<int>(intensity.cols()),
                        rig.pattern.period, options.steepest_slope);
  indexer.run(rig, rig.camera.project(center).z());
  fill_depth(nodes, planes, rig.pattern.period, result.depth);

  const auto known = static_cast<Eigen::Index>(
      std::count_if(nodes.begin(), nodes.end(), [](const Node& node) { return node.known; }));
  result.pixel.resize(2, known);
  result.position.resize(3, known);
  Eigen::Index column = 0;
  for (const Node& node : nodes) {
    if (!node.known) continue;
    result.pixel.col(column) << node.edge.column + 0.5, node.edge.y;
    result.position.col(column++) = planes.point(node.direction, node.depth);
  }
  return result;
}

}  // namespace weft
