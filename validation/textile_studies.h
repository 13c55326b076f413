#pragma once
/// Measurements of real textiles against the models: what weft_validate_textiles runs.
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "weft/base/types.h"

namespace weft::validation {

/// A row a line, commas between the numbers; lines that do not begin with a number are skipped.
/// Throws Error for a file that cannot be read and rows of different lengths.
MatX read_rows(const std::filesystem::path& path);

/// Root of the mean of squares, over the numbers that are not NaN.
double rms(const VecX& values);

/// Where the data are and the pictures go.
struct StudyFolders {
  std::filesystem::path data, out;
};

/// A cantilevered glass fabric: published profile and photograph to moment and curvature.
void study_photographed_cantilever(const StudyFolders& folders);
/// Moment-curvature and shear curve of a preform as stiffness curves.
void study_preform(const StudyFolders& folders);
/// Nylon strips at four angles to the warp: constants, and the angle left out.
void study_textile_strips(const StudyFolders& folders);
/// Bias extension of a glass fabric: shear curve, and the second half of the test from the first.
void study_bias_extension(const StudyFolders& folders);
/// Knits: two repeats from three, forces and widths, friction.
void study_knits(const StudyFolders& folders);
/// Drape of five fabrics: half of the samples from the other half.
void study_cusick(const StudyFolders& folders);
/// Strips of the measured tables of Wang et al. 2011: the model against the tables alone.
void study_wang2011(const StudyFolders& folders);
/// Strip and cantilever against closed forms, for every elastic model, by mesh.
void study_closed_forms(const StudyFolders& folders);
/// Bends from overhangs: by mesh, against the elastica; by width; from noisy readings.
void study_overhang(const StudyFolders& folders);

}  // namespace weft::validation
