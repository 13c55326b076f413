#pragma once
/// What the two studies of weft_validate_real_motion share.
#include <filesystem>
#include <string>
#include <vector>

#include "weft/estimate/motion_fit.h"
#include "weft/report/plot.h"

namespace weft::validation {

/// Cloth held by an arm: `folder` has NAME_mesh.csv (a time and x, y, z of n x n points in the
/// camera's frame a row), NAME_tcp.csv (a time, position and quaternion of the arm) for each of
/// `names`, and campose.csv.
void study_arm(const std::filesystem::path& out, const std::filesystem::path& folder,
               const std::vector<std::string>& names);
/// Registered frames (PC2, a square grid of `side` m) at `rate` frames/s of cloth that is blown by
/// air that nobody measured. `keys`: which unknowns (air, few, few_mass, all, all_mass); none: each
/// of these.
void study_video(const std::filesystem::path& out, const std::filesystem::path& registered,
                 double side, double rate, const std::vector<std::string>& keys);

/// Rows of numbers between commas; lines that begin with # or % are skipped, "nan" is a number.
std::vector<std::vector<double>> read_numbers(const std::filesystem::path& path);

/// One way to predict the motion: a name, and what it says at the tracked points.
struct Prediction {
  std::string name;
  std::vector<Points> position;  ///< a frame each
};
/// Prints mean, rms and median of the distance over frames before `split` and from there on, and
/// the part of the mean that is off the tracked surface.
void print_distances(const MotionTracks& tracks, std::size_t split,
                     const std::vector<Prediction>& predictions);
/// Mean distance of each frame against time.
void write_distances(const std::filesystem::path& path, const std::string& title,
                     const MotionTracks& tracks, std::size_t split,
                     const std::vector<Prediction>& predictions);
void print_intervals(const MotionFitResult& fit);

/// Inertia of the air that moves with the cloth over the cloth's own. Air that adds a times the
/// mass and no weight is gravity of 1 / (1 + a) for cloth of 1 + a times the density: what is found
/// of the fabric is then per 1 + a times the areal density. So is a frame rate that is taken
/// sqrt(1 + a) times too low.
SceneUnknown added_mass(double most);
MotionFitOptions fit_options();

}  // namespace weft::validation
