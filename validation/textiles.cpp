/// Measurements of real textiles against the models (textile_studies.h).
///
///     weft_validate_textiles DATA OUT [PART ...]
///
/// DATA has a folder for each part; tables that are compressed there are expected unpacked in
/// OUT/NAME (scripts/validate_textiles does that). Prints tables, writes pictures to OUT.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <map>
#include <sstream>

#include "program.h"
#include "textile_studies.h"
#include "weft/base/error.h"

namespace weft::validation {

MatX read_rows(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw Error(fmt::format("{}: cannot be read", path.string()));
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(in, line);) {
    std::istringstream cells(line);
    std::vector<double> row;
    for (std::string cell; std::getline(cells, cell, ',');) {
      char* end = nullptr;
      const double value = std::strtod(cell.c_str(), &end);
      if (end == cell.c_str()) break;
      row.push_back(value);
    }
    if (row.empty()) continue;
    if (!rows.empty() && row.size() != rows.front().size())
      throw Error(fmt::format("{}: rows of {} and {} numbers", path.string(), rows.front().size(),
                              row.size()));
    rows.push_back(std::move(row));
  }
  if (rows.empty()) throw Error(fmt::format("{}: no numbers", path.string()));
  MatX out(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(rows[0].size()));
  for (Eigen::Index i = 0; i < out.rows(); ++i)
    for (Eigen::Index j = 0; j < out.cols(); ++j)
      out(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  return out;
}

double rms(const VecX& values) {
  double sum = 0, count = 0;
  for (const double value : values)
    if (!std::isnan(value)) {
      sum += value * value;
      ++count;
    }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

namespace {

const std::vector<std::pair<std::string, std::function<void(const StudyFolders&)>>>& parts() {
  static const std::vector<std::pair<std::string, std::function<void(const StudyFolders&)>>> all{
      {"cantilever", study_photographed_cantilever},
      {"preform", study_preform},
      {"textile_strips", study_textile_strips},
      {"bias_extension", study_bias_extension},
      {"knits", study_knits},
      {"cusick", study_cusick},
      {"wang2011", study_wang2011},
      {"closed_forms", study_closed_forms},
      {"overhang", study_overhang}};
  return all;
}

void run(int argc, char** argv) {
  std::string names;
  for (const auto& [name, study] : parts()) names += " [" + name + "]";
  if (argc < 3) throw Error("usage: weft_validate_textiles DATA OUT" + names);
  const StudyFolders folders{argv[1], argv[2]};
  std::filesystem::create_directories(folders.out);
  const std::vector<std::string> wanted(argv + 3, argv + argc);
  for (const std::string& name : wanted)
    if (std::none_of(parts().begin(), parts().end(),
                     [&](const auto& p) { return p.first == name; }))
      throw Error(fmt::format("{} is no part; parts:{}", name, names));
  for (const auto& [name, study] : parts()) {
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), name) == wanted.end()) continue;
    fmt::print("\n== {}\n", name);
    const std::clock_t begin = std::clock();
    study(folders);
    fmt::print("({:.1f} s of processor time)\n",
               static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace weft::validation

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_textiles", [&] {
    weft::validation::run(argc, argv);
    return 0;
  });
}
