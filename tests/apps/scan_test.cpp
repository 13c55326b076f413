/// The subcommands that take scans, as a process.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "weft/estimate/scan_synthetic.h"
#include "weft/fabric/orthotropic.h"

namespace weft {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

constexpr double kSide = 0.1;  // m

class Scan : public ProgramTest {
 protected:
  void SetUp() override {
    ProgramTest::SetUp();
    ScanCapture capture;
    capture.name = "swatch";
    capture.width = capture.height = kSide;
    capture.areal_density = 0.2;
    std::vector<ScanShape> shapes;
    const TriangleMesh mesh = make_swatch(kSide, kSide, 6, 6, GridPattern::uniform);
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
};

TEST_F(Scan, ChecksEvaluatesAndFits) {
  const Outcome checked = weft({"check", path("scan")});
  ASSERT_EQ(checked.status, 0) << checked.err;
  EXPECT_THAT(checked.out, AllOf(HasSubstr("swatch (scan)"), HasSubstr("36 vertices"),
                                 HasSubstr("table (bar)"), HasSubstr("ok\n")));

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
  EXPECT_THAT(page, AllOf(HasSubstr("ledge along u"), HasSubstr("How well it matches")));

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
  EXPECT_THAT(refusal({"--parameters", "stretch"}), HasSubstr("stretch"));
  EXPECT_THAT(refusal({"--initial", "satin"}), HasSubstr("stvk"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out")) << "refused, but the folder was made";
  const Outcome simulated =
      weft({"simulate", path("scan"), "--fabric", "satin", "--out", path("x.pc2")});
  EXPECT_EQ(simulated.status, 2);
  EXPECT_THAT(simulated.err, HasSubstr("a scan; this command needs a video"));
}

}  // namespace
}  // namespace weft
