/// Refinement studies of the time integrators and of the mesh. Prints what each finds and a closing
/// table; writes pictures (SVG), each with its data (CSV):
///
///   cantilever        tip of a heavy cantilever against the elastica, by load and mesh
///   cantilever_error  its relative error, mesh by mesh
///   order             error of each integrator by the size of its steps
///   energy            energy of a swinging swatch over time, by integrator
///   mesh              static shape of a sagging swatch by mesh; all pairs in mesh_pairs.csv
///   parting, steps    distance over time between simulations of one fabric on two meshes, and with
///                     two sizes of steps
#include <algorithm>
#include <cstdio>

#include "program.h"
#include "study.h"

namespace {

using namespace weft::validation;

void print_table(const Findings& findings) {
  std::size_t first = 0, second = 0;
  for (const Finding& finding : findings) {
    first = std::max(first, finding.quantity.size());
    second = std::max(second, finding.measured.size());
  }
  std::puts("");
  for (const Finding& finding : findings) {
    const std::string verdict =
        finding.expected.empty()
            ? ""
            : fmt::format("{}: {}", finding.holds ? "as expected" : "NOT AS EXPECTED",
                          finding.expected);
    fmt::print("{:<{}}  {:<{}}  {}\n", finding.quantity, first, finding.measured, second, verdict);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::fputs("usage: weft_validate_dynamics OUT_FOLDER [CORNERS_CSV]\n", stderr);
    return 2;
  }
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);  // a line as soon as it is there
  return run_program("weft_validate_dynamics", [&] {
    const std::filesystem::path out = argv[1];
    std::filesystem::create_directories(out);
    Findings findings;
    study_cantilever(out, findings);
    study_order(out, findings);
    study_energy(out, findings);
    study_mesh(out, findings);
    if (argc == 3) study_parting(out, argv[2], findings);
    print_table(findings);
    return 0;
  });
}
