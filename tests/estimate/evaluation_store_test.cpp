#include "weft/estimate/evaluation_store.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "common/temporary_folder.h"
#include "estimate/analytic_problem.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"

namespace weft::evaluation_store_test {
namespace {

class EvaluationStoreTest : public ::testing::Test {
 protected:
  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
  Problem problem_ =
      analytic_problem({"bend_stiffness"}, [](const VecX& scaled) { return scaled[0]; });
};

TEST_F(EvaluationStoreTest, GivesBackExactlyWhatWasPutIn) {
  Fabric fabric = problem_.initial();
  fabric.values *= 1.0 / 3;  // no short decimal
  const ProblemEvaluation put{0.1 + 0.2, 1e-300, 123.456789012345678, 7, false, 0.25};
  const ProblemEvaluation lost{std::numeric_limits<double>::infinity(),
                               std::numeric_limits<double>::infinity(),
                               0,
                               0,
                               true,
                               1};
  {
    EvaluationStore store(folder_ / "evaluations.sqlite");
    EXPECT_FALSE(store.find(problem_, fabric, 0));
    store.add(problem_, fabric, 0, "anneal", put);
    store.add(problem_, fabric, 1, "coarse", lost);
  }
  const EvaluationStore store(folder_ / "evaluations.sqlite");
  const auto found = store.find(problem_, fabric, 0);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->error, put.error);
  EXPECT_EQ(found->error_per_frame, put.error_per_frame);
  EXPECT_EQ(found->fold, put.fold);
  EXPECT_EQ(found->silhouette, put.silhouette);
  EXPECT_EQ(found->wall_s, put.wall_s);
  EXPECT_FALSE(found->diverged);
  const auto diverged = store.find(problem_, fabric, 1);
  ASSERT_TRUE(diverged);
  EXPECT_EQ(diverged->error, lost.error);
  EXPECT_TRUE(diverged->diverged);
  EXPECT_EQ(store.count(problem_), 2u);
}

TEST_F(EvaluationStoreTest, KeepsNumbersByKeyAndProgram) {
  const Fabric fabric = problem_.initial();
  const VecX put = (VecX(3) << 1.0 / 3, -0.0, std::numeric_limits<double>::infinity()).finished();
  const auto path = folder_ / "evaluations.sqlite";
  {
    EvaluationStore store(path, "weft 1");
    EXPECT_FALSE(store.find_numbers(problem_, fabric, 0, "cost"));
    store.add_numbers(problem_, fabric, 0, "cost", put);
    store.add_numbers(problem_, fabric, 0, "cost", VecX::Zero(1));  // the first ones stay
  }
  const EvaluationStore store(path, "weft 1");
  const auto found = store.find_numbers(problem_, fabric, 0, "cost");
  ASSERT_TRUE(found);
  EXPECT_EQ(*found, put);
  EXPECT_TRUE(std::signbit((*found)[1]));
  EXPECT_FALSE(store.find_numbers(problem_, fabric, 0, "linearization"));
  EXPECT_FALSE(store.find_numbers(problem_, fabric, 1, "cost"));
  EXPECT_FALSE(EvaluationStore(path, "weft 2").find_numbers(problem_, fabric, 0, "cost"));
  EXPECT_EQ(store.count(), 0u) << "numbers are no evaluations";
}

TEST_F(EvaluationStoreTest, TellsTheSmallestDifferenceApart) {
  EvaluationStore store(folder_ / "evaluations.sqlite");
  Fabric fabric = problem_.initial();
  store.add(problem_, fabric, 0, "anneal", {});
  fabric.values[2] = std::nextafter(fabric.values[2], 1.0);
  EXPECT_FALSE(store.find(problem_, fabric, 0));
  // Another problem: one more frame to compare.
  auto other_trial = std::make_shared<Trial>(*problem_.trials()[0]);
  other_trial->features.resize(1);
  const Problem other({other_trial}, problem_.initial(), {"bend_stiffness"});
  EXPECT_NE(other.fingerprint(), problem_.fingerprint());
  EXPECT_FALSE(store.find(other, problem_.initial(), 0));
  EXPECT_EQ(store.count(other), 0u);
}

TEST_F(EvaluationStoreTest, FingerprintIgnoresWhichParametersAreFree) {
  const Problem other = analytic_problem({"stretch_stiffness"}, [](const VecX&) { return 0.0; });
  EXPECT_EQ(other.fingerprint(), problem_.fingerprint());
}

TEST_F(EvaluationStoreTest, TheFirstOfTwoStays) {
  EvaluationStore store(folder_ / "evaluations.sqlite");
  ProblemEvaluation first, second;
  first.error = 1;
  second.error = 2;
  store.add(problem_, problem_.initial(), 0, "anneal", first);
  store.add(problem_, problem_.initial(), 0, "anneal", second);
  EXPECT_EQ(store.find(problem_, problem_.initial(), 0)->error, 1);
}

TEST_F(EvaluationStoreTest, ManyThreadsAndTwoConnectionsWriteAtOnce) {
  EvaluationStore one(folder_ / "evaluations.sqlite"), two(folder_ / "evaluations.sqlite");
  parallel_for(40, 4, [&](std::size_t i) {
    Fabric fabric = problem_.initial();
    fabric.values[0] += double(i);
    (i % 2 == 0 ? one : two).add(problem_, fabric, 0, "coarse", {});
  });
  EXPECT_EQ(one.count(problem_), 40u);
}

TEST_F(EvaluationStoreTest, ReplaysInsteadOfEvaluating) {
  EvaluationStore store(folder_ / "evaluations.sqlite");
  const Fabric fabric = problem_.fabric(VecX::Constant(1, 0.25));
  EXPECT_FALSE(evaluate_stored(problem_, fabric, 0, "anneal", &store).replayed);
  const StoredEvaluation again = evaluate_stored(problem_, fabric, 0, "anneal", &store);
  EXPECT_TRUE(again.replayed);
  EXPECT_NEAR(again.evaluation.error, 0.25, 1e-12);
  EXPECT_FALSE(evaluate_stored(problem_, fabric, 0, "anneal", nullptr).replayed);
}

TEST_F(EvaluationStoreTest, RejectsWhatIsNoStore) {
  EXPECT_THROW(EvaluationStore(folder_ / "missing" / "evaluations.sqlite"), Error);
  std::ofstream(folder_ / "text.sqlite") << std::string(4096, 'x');
  try {
    EvaluationStore store(folder_ / "text.sqlite");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("text.sqlite"), std::string::npos);
  }
}

}  // namespace
}  // namespace weft::evaluation_store_test
