#include "weft/estimate/stored_evaluations.h"

#include <fmt/format.h>

#include <cmath>

#include "weft/estimate/sqlite_file.h"

namespace weft {
namespace {

constexpr double kSameValue = 1e-6;  // relative: fabric.toml has fewer digits than the store

}  // namespace

std::vector<StoredPoint> read_evaluations(const std::filesystem::path& path,
                                          const std::string& fingerprint,
                                          const std::vector<std::string>& parameters,
                                          const std::map<std::string, double>& fixed) {
  const detail::Database database(path, "store of evaluations");
  std::string columns;
  for (const std::string& name : parameters)
    columns += fmt::format(", json_extract(parameters, '$.{}')", name);
  std::string same;
  for (const auto& [name, value] : fixed)
    same += fmt::format("AND ABS(json_extract(parameters, '$.{}') - {:.17g}) <= {:.17g} ", name,
                        value, kSameValue * std::abs(value));
  std::vector<StoredPoint> points;
  const std::string sql = fmt::format(
      "SELECT error{} FROM evaluation "
      "WHERE problem = ?1 AND frame_count = 0 AND diverged = 0 {}ORDER BY id",
      columns, same);
  detail::Statement select = database.prepare(sql);
  select.bind(1, fingerprint);
  select.run([&](const detail::Row& row) {
    StoredPoint point{VecX(static_cast<Eigen::Index>(parameters.size())), row.number(0)};
    for (Eigen::Index i = 0; i < point.values.size(); ++i)
      point.values[i] = row.number(static_cast<int>(i) + 1);
    if (std::isfinite(point.error)) points.push_back(std::move(point));
  });
  return points;
}

}  // namespace weft
