#pragma once
/// What the studies of weft_validate_dynamics share: CSV files and the rows of its closing table.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "weft/base/error.h"
#include "weft/base/types.h"

namespace weft::validation {

/// A CSV file with a header line.
class Csv {
 public:
  Csv(const std::filesystem::path& path, std::string_view header) : out_(path) {
    if (!out_) throw Error(fmt::format("{}: cannot be written", path.string()));
    out_ << header << '\n';
  }
  template <class... T>
  void row(fmt::format_string<T...> format, T&&... values) {
    out_ << fmt::format(format, std::forward<T>(values)...) << '\n';
  }

 private:
  std::ofstream out_;
};

/// A row of the closing table.
struct Finding {
  std::string quantity;
  std::string measured;
  std::string expected;  ///< empty: reported, nothing is claimed
  bool holds = true;
};
using Findings = std::vector<Finding>;

/// Heavy cantilever against the elastica: three mesh resolutions, two triangulations.
void study_cantilever(const std::filesystem::path& out, Findings& findings);
/// Error of each integrator by the size of its steps.
void study_order(const std::filesystem::path& out, Findings& findings);
/// Energy of an undamped swinging swatch over time, by integrator.
void study_energy(const std::filesystem::path& out, Findings& findings);
/// Static shape of a sagging swatch by mesh.
void study_mesh(const std::filesystem::path& out, Findings& findings);
/// Distance over time between two simulations of one fabric, which differ in mesh or steps.
/// `corners`: motion CSV of the two upper corners: time, left x y z, right x y z.
void study_parting(const std::filesystem::path& out, const std::filesystem::path& corners,
                   Findings& findings);

}  // namespace weft::validation
