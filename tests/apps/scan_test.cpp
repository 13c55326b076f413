/// The subcommands that take scans, as a process.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>
#include <utility>

#include "apps/program.h"
#include "apps/store.h"
#include "weft/estimate/scan_synthetic.h"
#include "weft/fabric/orthotropic.h"
#include "weft/mesh/mesh_io.h"

namespace weft::scan_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr double kSide = 0.1;  // m

double true_b() { return stiffness_of(find_fabric("larionov-cotton")).b; }

class Scan : public ProgramTest {
 protected:
  void SetUp() override {
    ProgramTest::SetUp();
    ScanCapture capture;
    capture.name = "swatch";
    capture.width = capture.height = kSide;
    capture.areal_density = 0.2;
    std::vector<ScanShape> shapes;
    const TriangleMesh mesh = make_swatch(kSide, kSide, 6, 6);
    ScanSynthesis options;
    options.noise = 1e-5;
    options.stated_noise = 1e-5;
    options.stated_force_noise = 1e-3;
    for (const ScanExperiment& e : {picture_frame(kSide, kSide, 0.2, 5e-4),
                                    edge_stretch(kSide, kSide, ScanAxis::u, 0.05, 5e-4),
                                    edge_stretch(kSide, kSide, ScanAxis::v, 0.05, 5e-4),
                                    ledge(kSide, kSide, ScanAxis::u, 0.04)}) {
      SynthesizedScan scan = synthesize_scan(e, mesh, find_fabric("larionov-cotton"), options);
      capture.targets.push_back(scan.target);
      shapes.push_back(scan.shape);
    }
    write_scan_capture(folder_ / "scan", capture, shapes);
  }
  int rows_of_store(const char* sql) const {
    return run_sql(folder_ / "out/scan_evaluations.sqlite", sql);
  }
};

TEST_F(Scan, ChecksEvaluatesAndFits) {
  const Outcome checked = weft({"check", path("scan")});
  ASSERT_EQ(checked.status, 0) << checked.err;
  EXPECT_THAT(checked.out,
              AllOf(HasSubstr("swatch (scan)"), HasSubstr("36 vertices"),
                    HasSubstr("36 of them measured"), HasSubstr("table (bar)"), HasSubstr("ok\n")));

  const Outcome fit = weft({"fit", path("scan"), "--out", path("out"), "--initial",
                            "larionov-initial", "--schedule", "alternating"});
  ASSERT_EQ(fit.status, 0) << fit.err;
  EXPECT_THAT(fit.out, AllOf(HasSubstr("E_u"), HasSubstr("bend"), HasSubstr("ledge along u")));
  const nlohmann::json result = nlohmann::json::parse(text_of(folder_ / "out/result.json"));
  // A hundredth of a millimetre of noise, in a strain of 5 % over 0.1 m: 0.2 %.
  EXPECT_NEAR(result["scan"]["moduli"]["E_u"].get<double>(), 100, 1);
  EXPECT_NEAR(result["scan"]["moduli"]["mu"].get<double>(), 40, 2);
  EXPECT_EQ(result["scan"]["targets"].size(), 4u);
  EXPECT_EQ(result["settings"]["descriptor"], "fourier");
  const std::string page = text_of(folder_ / "out/report.html");
  EXPECT_THAT(page, AllOf(HasSubstr("ledge along u"), HasSubstr("How well it matches"),
                          HasSubstr("<b>E_u</b>"), HasSubstr("Forces of the clamps"),
                          Not(HasSubstr("raw scans")), HasSubstr("tied to bend uu")));
  // Four stiffnesses of the membrane and one rigidity, which three values of the fabric have.
  EXPECT_THAT(page, AllOf(HasSubstr("5 of 5"), Not(HasSubstr("7 of 7"))));
  EXPECT_EQ(result["parameters"]["bend_vv"]["tied_to"], "bend_uu");
  EXPECT_FALSE(result["parameters"]["bend_uu"].contains("tied_to"));
  // mu and b are what was searched, in other words.
  const nlohmann::json& intervals = result["scan"]["moduli_intervals"];
  for (const auto& [modulus, name] :
       {std::pair("mu", "membrane_shear"), std::pair("b", "bend_uu")}) {
    const nlohmann::json& p = result["parameters"][name];
    EXPECT_NEAR(intervals[modulus][0].get<double>() / p["interval_lower"].get<double>(), 1, 1e-6);
    EXPECT_NEAR(intervals[modulus][1].get<double>() / p["interval_upper"].get<double>(), 1, 1e-6);
  }
  const double e_u = result["scan"]["moduli"]["E_u"];
  EXPECT_LT(intervals["E_u"][0].get<double>(), e_u);
  EXPECT_GT(intervals["E_u"][1].get<double>(), e_u);
  EXPECT_EQ(result["scan"]["targets"][1]["clamps"][0]["force_noise"], 1e-3);

  const Outcome evaluated =
      weft({"evaluate", path("scan"), "--fabric", path("out/fabric.toml"), "--json"});
  ASSERT_EQ(evaluated.status, 0) << evaluated.err;
  const nlohmann::json evaluation = nlohmann::json::parse(evaluated.out);
  EXPECT_EQ(evaluation["kind"], "scan");
  for (const auto& target : evaluation["targets"]) {
    EXPECT_TRUE(target["converged"].get<bool>());
    EXPECT_LT(target["distance_mean"].get<double>(), 3e-4);
    EXPECT_EQ(target["within_near"], 1);
  }
  EXPECT_EQ(evaluation["targets"][1]["clamps"][0]["name"], "left");

  // What sampling by simulation takes from the result.
  const auto refused = [&](const char* pointer, const nlohmann::json& value) {
    nlohmann::json other = result;
    other[nlohmann::json::json_pointer(pointer)] = value;
    write("out/result.json", other.dump());
    return refusal({"posterior", path("out"), "--true-cost", "--steps", "10"});
  };
  const std::string file = path("out/result.json") + ": ";
  EXPECT_THAT(refused("/scan", 5), StartsWith(file + "scan.captures: is missing"));
  EXPECT_EQ(refused("/scan/captures/0", 5), file + "scan.captures[0]: a text is needed");
  EXPECT_EQ(refused("/settings/registered cells", 1),
            file + "settings: \"registered cells\": 1; valid: 2 to 400");
  EXPECT_EQ(refused("/scan/targets", nlohmann::json::array()),
            file + "scan.targets: has 0 targets, but its captures 4");
  EXPECT_EQ(refused("/scan/targets/1/noise_factor", 0),
            file + "scan.targets[1].noise_factor: 0; must be above 0");
}

TEST_F(Scan, IntervalsSayWhatTheMeshDoes) {
  const auto fit = [&](const std::string& out, std::vector<std::string> more) {
    std::vector<std::string> words{"fit",     path("scan"), "--out",
                                   path(out), "--initial",  "larionov-initial"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = weft(words);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return nlohmann::json::parse(text_of(folder_ / out / "result.json"));
  };
  const nlohmann::json with = fit("with", {}), without = fit("without", {"--no-mesh-error"});
  EXPECT_EQ(with["settings"]["intervals"], "noise and mesh");
  EXPECT_EQ(without["settings"]["intervals"], "noise");
  EXPECT_THAT(text_of(folder_ / "with/report.html"), HasSubstr("What the width of the cells does"));
  EXPECT_THAT(text_of(folder_ / "without/report.html"),
              Not(HasSubstr("What the width of the cells does")));
  EXPECT_TRUE(without["mesh_shift"].is_object());
  EXPECT_TRUE(without["mesh_shift"].empty());
  ASSERT_EQ(with["mesh_shift"].size(), 5u);
  const auto upper = [](const nlohmann::json& result, const char* name) {
    return result["parameters"][name]["interval_upper"].get<double>();
  };
  // One rigidity in all directions.
  for (const auto& [searched, name] :
       {std::pair("membrane_uu", "membrane_uu"), std::pair("bend", "bend_uu"),
        std::pair("bend", "bend_vv"), std::pair("bend", "bend_twist")}) {
    const double shift = with["mesh_shift"][searched].get<double>();
    EXPECT_GT(std::abs(shift), 1e-4) << name;
    EXPECT_NEAR(upper(with, name) / upper(without, name), std::exp(2 * std::abs(std::log1p(shift))),
                1e-6)
        << name;
  }
  // XPBD solves the same equations; the static solver takes the finer cells.
  const nlohmann::json by_xpbd = fit("xpbd", {"--solver", "xpbd"});
  EXPECT_EQ(by_xpbd["settings"]["solver of the mesh's error"], "static");
  EXPECT_FALSE(with["settings"].contains("solver of the mesh's error"));
  for (const char* name : {"membrane_uu", "bend"}) {
    const double shift = with["mesh_shift"][name].get<double>();
    EXPECT_NEAR(by_xpbd["mesh_shift"][name].get<double>(), shift, 0.05 * std::abs(shift)) << name;
  }
}

TEST_F(Scan, FitsOtherModels) {
  const Outcome fit = weft({"fit", path("scan"), "--out", path("out"), "--model",
                            "baraff-witkin-diagonals", "--no-mesh-error", "--random-starts", "1"});
  ASSERT_EQ(fit.status, 0) << fit.err;
  EXPECT_THAT(fit.out, AllOf(HasSubstr("diagonal_stiffness"), Not(HasSubstr("E_u"))));
  const nlohmann::json scan = nlohmann::json::parse(text_of(folder_ / "out/result.json"))["scan"];
  EXPECT_FALSE(scan.contains("moduli"));
  EXPECT_EQ(scan["values"].size(), 4u);
  EXPECT_EQ(scan["starts"].size(), 2u);
  const auto start = [&](std::size_t i) {
    return scan["starts"][i]["start"]["stretch_stiffness"].get<double>();
  };
  EXPECT_NEAR(start(0), 500, 1e-9);  // to its logarithm and back
  EXPECT_GT(std::abs(start(1) - 500), 1);
}

/// As the last lines of a fit say.
std::pair<int, int> replayed_of_evaluations(const Outcome& fit) {
  std::smatch found;
  const std::regex words(R"((\d+) evaluations \((\d+) replayed\))");
  if (!std::regex_search(fit.out, found, words)) return {-1, -1};
  return {std::stoi(found[2]), std::stoi(found[1])};
}

TEST_F(Scan, AKilledFitContinues) {
  const std::vector<std::string> words{"fit",       path("scan"),       "--out",     path("out"),
                                       "--initial", "larionov-initial", "--balance", "noise"};
  const Outcome whole = weft(words);
  ASSERT_EQ(whole.status, 0) << whole.err;
  EXPECT_THAT(refusal(words), HasSubstr("--overwrite"));
  EXPECT_EQ(replayed_of_evaluations(whole).first, 0);
  const std::string fabric = text_of(folder_ / "out/fabric.toml");
  const int computed = rows_of_store("SELECT count(*) FROM numbers");
  EXPECT_GT(computed, 5);
  // As if it had been killed half way.
  std::filesystem::remove(folder_ / "out/result.json");
  std::filesystem::remove(folder_ / "out/fabric.toml");
  rows_of_store("DELETE FROM numbers WHERE rowid > (SELECT count(*) / 2 FROM numbers)");
  const Outcome again = weft(words);
  ASSERT_EQ(again.status, 0) << again.err;
  const auto [half, evaluations] = replayed_of_evaluations(again);
  EXPECT_GT(half, 0);
  EXPECT_LT(half, evaluations);
  EXPECT_EQ(text_of(folder_ / "out/fabric.toml"), fabric);
  EXPECT_EQ(rows_of_store("SELECT count(*) FROM numbers"), computed);

  // What is there is taken: 1000 in place of the cost of the start, which is asked for first.
  std::filesystem::remove(folder_ / "out/result.json");
  rows_of_store("UPDATE numbers SET value = X'0000000000408F40' WHERE rowid = 1");
  const Outcome replayed = weft(words);
  ASSERT_EQ(replayed.status, 0) << replayed.err;
  // All but those without an equilibrium, which are not kept.
  EXPECT_GT(replayed_of_evaluations(replayed).first, half);
  EXPECT_EQ(replayed_of_evaluations(replayed).second, evaluations);
  EXPECT_EQ(nlohmann::json::parse(text_of(folder_ / "out/result.json"))["error_initial"], 1000);
  EXPECT_EQ(text_of(folder_ / "out/fabric.toml"), fabric);
  std::filesystem::remove(folder_ / "out/result.json");
  std::vector<std::string> other = words;
  other.insert(other.end(), {"--descriptor", "position"});
  EXPECT_THAT(refusal(other), HasSubstr("scan_evaluations.sqlite: of another run"));
}

TEST_F(Scan, RefusesWhatIsNotForScans) {
  const auto refusal = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"fit", path("scan"), "--out", path("out")};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = weft(words);
    EXPECT_EQ(outcome.status, 2);
    return outcome.err;
  };
  EXPECT_THAT(refusal({"--alpha", "0.2"}), HasSubstr("--alpha: means nothing for scans"));
  EXPECT_THAT(refusal({"--force-noise", "0.2"}), HasSubstr("--force-noise: means nothing"));
  EXPECT_THAT(refusal({"--descriptor", "wavelet"}), HasSubstr("--descriptor"));
  EXPECT_THAT(refusal({"--rounds", "0"}), HasSubstr("--rounds"));
  EXPECT_THAT(refusal({"--rounds", "2"}), HasSubstr("--rounds: only with --schedule alternating"));
  EXPECT_THAT(refusal({"--seed", "2"}), HasSubstr("--seed: only with --random-starts"));
  EXPECT_THAT(refusal({path("scan/")}),
              HasSubstr("captures: " + path("scan/") + " is given twice"));
  EXPECT_THAT(refusal({"--parameters", "stretch"}), HasSubstr("stretch"));
  EXPECT_THAT(refusal({"--initial", "satin", "--descriptor", "energy"}), HasSubstr("stvk"));
  EXPECT_THAT(refusal({"--initial", "satin", "--parameters", "bend"}), HasSubstr("bend"));
  EXPECT_THAT(refusal({"--model", "baraff-witkin", "--solver", "xpbd"}),
              HasSubstr("solver \"xpbd\" does not take"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out")) << "refused, but the folder was made";
  EXPECT_EQ(ProgramTest::refusal({"evaluate", path("scan"), "--fabric", "larionov-cotton",
                                  "--registered-cells", "9"}),
            "--registered-cells: means nothing for grids that are registered");
  EXPECT_THAT(refusal({"--registered-cells", "9"}),
              HasSubstr("--registered-cells: means nothing for grids that are registered"));
  const Outcome simulated =
      weft({"simulate", path("scan"), "--fabric", "satin", "--out", path("x.pc2")});
  EXPECT_EQ(simulated.status, 2);
  EXPECT_THAT(simulated.err, HasSubstr("a scan; this command needs a video"));
}

TEST_F(Scan, SynthesizesTheExperiments) {
  const Outcome made = weft({"synthesize", "--scan", "--fabric", "larionov-cotton", "--out",
                             path("made"), "--swatch", "0.1x0.08", "--experiments", "frame:10",
                             "stretch-v:0.04", "corners:0.01,0.02,0.9", "edge-u:0.05",
                             "ledge-v:0.03", "--registered-cells", "8", "--no-noise"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("5 registered scans of larionov-cotton"));
  const ScanCapture capture = read_scan_capture(path("made"));
  EXPECT_EQ(capture.width, 0.1);
  EXPECT_EQ(capture.height, 0.08);
  ASSERT_EQ(capture.targets.size(), 5u);
  EXPECT_EQ(read_fabric(path("made/truth/fabric.toml")).model, "stvk");
  // The weights carry themselves, what is hung by the clamps besides the cloth.
  const std::vector<ScanClamp>& corners = capture.targets[2].clamps;
  EXPECT_NEAR(corners[2].force.value(), 9.81 * 0.01, 1e-9);
  EXPECT_NEAR(corners[3].force.value(), 9.81 * 0.02, 1e-9);
  const ScanClamp& top = capture.targets[3].clamps[0];
  EXPECT_NEAR(top.force.value(), 9.81 * (0.05 + capture.areal_density * 0.1 * 0.08), 1e-4);
  // A tenth of 0.1 m is one of 10 cells; 0.03 m are 3.
  EXPECT_NEAR(top.region.upper.x(), 0.01, 1e-9);
  EXPECT_NEAR(capture.targets[4].clamps[0].region.upper.y(), 0.03, 1e-9);
  // The mesh of the truth is finer: on the grid that is written the shapes are near, not equal. A
  // cell of it is 1 cm wide, where cloth that hangs over a table's edge bends within 2 cm.
  const Outcome evaluated =
      weft({"evaluate", path("made"), "--fabric", path("made/truth/fabric.toml"), "--json"});
  ASSERT_EQ(evaluated.status, 0) << evaluated.err;
  const nlohmann::json evaluation = nlohmann::json::parse(evaluated.out);
  for (const auto& target : evaluation["targets"]) {
    EXPECT_LT(target["distance_mean"].get<double>(), 3e-3) << target;
    EXPECT_GT(target["distance_mean"].get<double>(), 1e-7) << target;
  }
}

TEST_F(Scan, FitsACloudBesideRegisteredScans) {
  // Perfect forces and shapes, but of a cloud with a hole and strays.
  const auto synthesize = [&](const std::string& folder, std::vector<std::string> more) {
    std::vector<std::string> words{
        "synthesize",   "--scan",   "--fabric", "larionov-cotton",    "--out",
        path(folder),   "--swatch", "0.1x0.1",  "--registered-cells", "8",
        "--refinement", "1"};
    words.insert(words.end(), more.begin(), more.end());
    return weft(words);
  };
  const Outcome cloud =
      synthesize("cloud", {"--experiments", "ledge-u:0.05", "frame:12", "--clouds", "--points",
                           "6000", "--hole", "0.02", "--outliers", "0.1", "--noise", "1e-4"});
  ASSERT_EQ(cloud.status, 0) << cloud.err;
  const Outcome grids = synthesize("grids", {"--experiments", "stretch-u:0.05", "stretch-v:0.05"});
  ASSERT_EQ(grids.status, 0) << grids.err;
  const Outcome checked = weft({"check", path("cloud")});
  ASSERT_EQ(checked.status, 0) << checked.err;
  EXPECT_THAT(checked.out,
              HasSubstr("raw scan target_1.xyz, which a fit registers: 5241 points, 0."));
  const std::string points = text_of(folder_ / "cloud/target_1.xyz");
  write("cloud/target_1.xyz", "0 0\n");
  EXPECT_THAT(refusal({"check", path("cloud")}), HasSubstr("target_1.xyz:1: 2 numbers"));
  write("cloud/target_1.xyz", points);

  const Outcome fit = weft({"fit", path("grids"), path("cloud"), "--out", path("out"), "--initial",
                            "larionov-initial", "--registered-cells", "8"});
  ASSERT_EQ(fit.status, 0) << fit.err;
  const nlohmann::json result = nlohmann::json::parse(text_of(folder_ / "out/result.json"));
  ASSERT_EQ(result["scan"]["targets"].size(), 4u);
  EXPECT_FALSE(result["scan"]["targets"][0].contains("registration"));
  const nlohmann::json registration = result["scan"]["targets"][2]["registration"];
  EXPECT_EQ(registration["vertices"], 81);
  // 0.02 m about a vertex next to its middle: four or more of a grid of 0.0125 m.
  EXPECT_GE(registration["unsupported_vertices"].get<int>(), 4);
  EXPECT_LT(registration["residual_median"].get<double>(), 1.5e-4);
  EXPECT_THAT(
      text_of(folder_ / "out/report.html"),
      HasSubstr(fmt::format("{} of 81 (", registration["unsupported_vertices"].get<int>())));
  const std::string weights = text_of(folder_ / "out/registered_3_weights.csv");
  EXPECT_EQ(std::count(weights.begin(), weights.end(), '\n'), 82);
  // Row 4 of column 5, (0.0625, 0.05) m, in the middle of the hole.
  EXPECT_EQ(read_obj(folder_ / "out/registered_3.obj").positions.cols(), 81);
  // Bending is seen by the cloud of the ledge alone.
  EXPECT_NEAR(result["scan"]["moduli"]["b"].get<double>() / true_b(), 1, 0.1);
}

TEST_F(Scan, RefusesWhatCannotBeSynthesized) {
  const auto why = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"synthesize", "--fabric", "larionov-cotton", "--out", path("x")};
    words.insert(words.end(), more.begin(), more.end());
    return refusal(words);
  };
  EXPECT_THAT(why({"--scan", "--experiments", "twist:3"}), HasSubstr("no such experiment; frame"));
  EXPECT_THAT(why({"--scan", "--experiments", "frame:75"}), HasSubstr("valid: -60 to 60"));
  EXPECT_THAT(why({"--scan", "--experiments", "corners:0.1"}),
              HasSubstr("given: 1, needed: 2 to 3"));
  EXPECT_THAT(why({"--scan", "--experiments", "ledge-u:abc"}), HasSubstr("expected NAME:NUMBER"));
  EXPECT_THAT(why({"--scan", "--experiments", "ledge-u:0.2"}), HasSubstr("valid: 0.001 to 0.15"));
  EXPECT_THAT(why({"--scan", "--rig"}), HasSubstr("exclude"));
  EXPECT_THAT(why({"--scan", "--frames", "3"}), HasSubstr("--frames"));
  EXPECT_THAT(why({"--scan", "--hole", "0.01"}), HasSubstr("--hole: only with --clouds"));
  EXPECT_THAT(why({"--clouds"}), HasSubstr("--clouds: only with --scan"));
}

}  // namespace
}  // namespace weft::scan_test
