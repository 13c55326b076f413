#include "weft/estimate/packed_numbers.h"

namespace weft {

void add_parts(const std::vector<CostPart>& parts, NumberWriter& writer) {
  for (const CostPart& part : parts) {
    writer.add(static_cast<double>(part.trial));
    writer.add(static_cast<double>(part.frame));
    writer.add(part.gradient);
    writer.add(part.hessian);
  }
}

std::vector<CostPart> read_parts(NumberReader& reader, Eigen::Index size) {
  std::vector<CostPart> parts;
  while (!reader.done()) {
    CostPart part;
    part.trial = static_cast<std::size_t>(reader.number());
    part.frame = static_cast<int>(reader.number());
    part.gradient = reader.vector(size);
    part.hessian = reader.matrix(size, size);
    parts.push_back(std::move(part));
  }
  return parts;
}

}  // namespace weft
