// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/matching/find_candidates.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr double kFocalLengthPx = 700.0;
constexpr int kNumPoints = 400;

// Points 3 to 60 m in front of camera 1, as both cameras see them. The true
// motion is drawn from the prediction's covariance.
struct Views {
  PlaneKeypoints keypoints1, keypoints2;
};

class FindCandidatesTest : public testing::Test {
 protected:
  PredictedMotion Predict(const Eigen::Vector3d& translation,
                          double rotation_sigma, double translation_sigma) {
    PredictedMotion prediction;
    prediction.cam2_from_cam1 =
        Rigid3d(ExpSo3(Eigen::Vector3d(0.01, 0.05, -0.02)), translation);
    prediction.covariance.diagonal()
        << Eigen::Vector3d::Constant(rotation_sigma * rotation_sigma),
        Eigen::Vector3d::Constant(translation_sigma * translation_sigma);
    return prediction;
  }

  Views Look(const PredictedMotion& prediction, double noise_px) {
    const Eigen::Matrix<double, 6, 1> sigmas =
        prediction.covariance.diagonal().cwiseSqrt();
    const auto draw = [&](int first) {
      return Eigen::Vector3d(random_.Gaussian(sigmas(first)),
                             random_.Gaussian(sigmas(first + 1)),
                             random_.Gaussian(sigmas(first + 2)));
    };
    const Rigid3d truth(ExpSo3(draw(0)) * prediction.cam2_from_cam1.rotation,
                        prediction.cam2_from_cam1.translation + draw(3));
    Views views;
    views.keypoints1.pixel_size = views.keypoints2.pixel_size =
        1.0 / kFocalLengthPx;
    while (views.keypoints1.points.size() < kNumPoints) {
      const double depth = random_.Uniform(3.0, 60.0);
      const Eigen::Vector3d point1 =
          depth * Eigen::Vector3d(random_.Uniform(-0.8, 0.8),
                                  random_.Uniform(-0.3, 0.3), 1.0);
      const Eigen::Vector3d point2 =
          truth.rotation * point1 + truth.translation;
      if (point2.z() < 0.3 * depth || point2.hnormalized().norm() > 1.0) {
        continue;
      }
      const auto noise = [&]() -> Eigen::Vector2d {
        return Eigen::Vector2d(random_.Gaussian(noise_px),
                               random_.Gaussian(noise_px)) /
               kFocalLengthPx;
      };
      views.keypoints1.points.push_back(point1.hnormalized() + noise());
      views.keypoints2.points.push_back(point2.hnormalized() + noise());
    }
    return views;
  }

  // The share of the true matches (i, i) that are among the candidates.
  static double Recall(const MatchCandidates& candidates) {
    int num_found = 0;
    for (int i = 0; i < kNumPoints; ++i) {
      const auto begin = candidates.indices.begin() + candidates.begins[i];
      const auto end = candidates.indices.begin() + candidates.begins[i + 1];
      num_found += std::find(begin, end, i) != end;
    }
    return static_cast<double>(num_found) / kNumPoints;
  }

  Random random_{3};
};

TEST_F(FindCandidatesTest, TrueMatchesAreAmongFewCandidates) {
  const Eigen::Vector3d translations[] = {
      {0.0, 0.0, -1.5}, {1.0, 0.1, 0.0}, {0.3, 0.0, 1.0}, {0.05, 0.0, 0.0}};
  for (const Eigen::Vector3d& translation : translations) {
    double recall = 0.0;
    double share = 0.0;
    constexpr int kNumDraws = 10;
    for (int draw = 0; draw < kNumDraws; ++draw) {
      const PredictedMotion prediction =
          Predict(translation, 5e-4, 0.01 * translation.norm());
      const Views views = Look(prediction, 0.5);
      MatchCandidates candidates;
      ASSERT_TRUE(FindCandidates(prediction, views.keypoints1, views.keypoints2,
                                 &candidates));
      ASSERT_EQ(candidates.begins.size(), kNumPoints + 1);
      recall += Recall(candidates) / kNumDraws;
      share += candidates.indices.size() /
               static_cast<double>(kNumPoints * kNumPoints) / kNumDraws;
    }
    EXPECT_GT(recall, 0.995) << translation.transpose();
    EXPECT_LT(share, 0.05) << translation.transpose();
  }
}

// Only keypoints in the predicted direction are candidates: one on the epipolar
// line where only points behind the cameras would lie is not.
TEST_F(FindCandidatesTest, TheWrongSideOfInfinityIsNoCandidate) {
  PredictedMotion prediction;
  prediction.cam2_from_cam1.translation = Eigen::Vector3d(1.0, 0.0, 0.0);
  prediction.covariance *= 1e-8;
  PlaneKeypoints keypoints1;
  keypoints1.pixel_size = 1.0 / kFocalLengthPx;
  PlaneKeypoints keypoints2 = keypoints1;
  keypoints1.points = {{0.1, 0.0}};
  keypoints2.points = {{0.15, 0.0}, {0.05, 0.0}, {0.15, 0.05}, {1.3, 0.0}};
  // Others off the line, so that one candidate is not too large a share.
  for (int k = 1; k <= 8; ++k) keypoints2.points.emplace_back(0.15, 0.1 * k);
  MatchCandidates candidates;
  ASSERT_TRUE(FindCandidates(prediction, keypoints1, keypoints2, &candidates));
  EXPECT_EQ(candidates.indices, std::vector<int>{0});
}

TEST_F(FindCandidatesTest, APoorPredictionIsRefused) {
  const PredictedMotion prediction =
      Predict(Eigen::Vector3d(0.0, 0.0, -1.5), 0.2, 1.0);
  const Views views =
      Look(Predict(Eigen::Vector3d(0.0, 0.0, -1.5), 0.0, 0.0), 0.5);
  MatchCandidates candidates;
  EXPECT_FALSE(FindCandidates(prediction, views.keypoints1, views.keypoints2,
                              &candidates));
}

}  // namespace
}  // namespace adasfm
