// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/render_world.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "synthetic/mip_texture.h"

namespace adasfm {
namespace {

SyntheticWorldOptions SmallOptions() {
  SyntheticWorldOptions options;
  options.num_images = 12;
  options.image_width = 320;
  options.image_height = 200;
  options.num_keypoints_per_image = 60;
  return options;
}

// The mean brightness of 3x3 pixels around a point of the world, when the
// image sees it.
std::optional<double> Brightness(const SyntheticWorld& world,
                                 const cv::Mat& photo,
                                 const SyntheticImage& image,
                                 const Eigen::Vector3d& point) {
  Eigen::Vector2d pixel;
  const Eigen::Vector3d center = image.cam_from_world.TargetOriginInSource();
  if (!ProjectPoint(world.camera, image.cam_from_world * point, &pixel) ||
      pixel.x() < 2.0 || pixel.y() < 2.0 || pixel.x() > photo.cols - 2.0 ||
      pixel.y() > photo.rows - 2.0 ||
      !HasLineOfSight(center.head<2>(), point.head<2>())) {
    return std::nullopt;
  }
  const int column = static_cast<int>(pixel.x());
  const int row = static_cast<int>(pixel.y());
  const cv::Scalar mean = cv::mean(photo(cv::Rect(column - 1, row - 1, 3, 3)));
  return (mean[0] + mean[1] + mean[2]) / 3.0;
}

double Correlation(const std::vector<std::pair<double, double>>& values) {
  double mean_a = 0.0, mean_b = 0.0;
  for (const auto& [a, b] : values) {
    mean_a += a / values.size();
    mean_b += b / values.size();
  }
  double aa = 0.0, bb = 0.0, ab = 0.0;
  for (const auto& [a, b] : values) {
    aa += (a - mean_a) * (a - mean_a);
    bb += (b - mean_b) * (b - mean_b);
    ab += (a - mean_a) * (b - mean_b);
  }
  return ab / std::sqrt(aa * bb);
}

// Correlation of the brightness of facade points of one street in photo 1 with
// that of the same places of another street (or the same one) in photo 2.
double FacadeCorrelation(const SyntheticWorld& world, WorldRenderer* renderer,
                         const Street& street1, size_t index1,
                         const Street& street2, size_t index2) {
  const cv::Mat photo1 = renderer->Render(index1);
  const cv::Mat photo2 = renderer->Render(index2);
  Random random(1);
  std::vector<std::pair<double, double>> values;
  for (int i = 0; i < 20000; ++i) {
    const double side = random.Uniform(0.0, 1.0) < 0.5 ? -1.0 : 1.0;
    const Eigen::Vector3d uvz(
        random.Uniform(kStreetHalfWidth + 0.1,
                       kBlockSize - kStreetHalfWidth - 0.1),
        side * kStreetHalfWidth, random.Uniform(0.1, 7.0));
    const Eigen::Vector3d point1 = street1.WorldFromLocal(uvz);
    // Near enough to show details.
    if ((world.images[index1].cam_from_world * point1).norm() > 25.0) continue;
    const auto a = Brightness(world, photo1, world.images[index1], point1);
    const auto b = Brightness(world, photo2, world.images[index2],
                              street2.WorldFromLocal(uvz));
    if (a && b) values.emplace_back(*a, *b);
  }
  EXPECT_GT(values.size(), 200);
  return Correlation(values);
}

// The same street seen in the other direction: its far end comes first.
Street OppositeStreet(const Street& street) {
  Street opposite = street;
  std::swap(opposite.from, opposite.to);
  return opposite;
}

TEST(WorldRenderer, PhotosShowTheSameFacadesWhereTheyProject) {
  for (const auto model :
       {SyntheticCameraModel::kPinhole, SyntheticCameraModel::kFisheye}) {
    SyntheticWorldOptions options = SmallOptions();
    options.camera_model = model;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const StreetGrid grid = BuildStreetGrid(options);
    WorldRenderer renderer(world);
    const Street& street = grid.streets[0];
    EXPECT_GT(FacadeCorrelation(world, &renderer, street, 4, street, 5), 0.85);
    // A control: other facades do not match.
    const Street other = OppositeStreet(street);
    EXPECT_LT(FacadeCorrelation(world, &renderer, street, 4, other, 5), 0.5);
  }
}

TEST(WorldRenderer, TwinStreetsLookAlike) {
  SyntheticWorldOptions options = SmallOptions();
  options.num_images = 250;
  options.alias_pair_ratio = 0.05;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  const StreetGrid grid = BuildStreetGrid(options, world.num_twins);
  WorldRenderer renderer(world);
  int num_tested = 0;
  for (const SyntheticPair& pair : world.pairs) {
    if (!pair.is_alias || num_tested == 3) continue;
    const size_t index1 = pair.image_id1 - 1;
    const size_t index2 = pair.image_id2 - 1;
    // The twin street that image 1 stands in.
    for (const Street& street : grid.streets) {
      const Eigen::Vector3d uvz = street.LocalFromWorld(
          world.images[index1].cam_from_world.TargetOriginInSource());
      if (street.twin < 0 || uvz.x() < 5.0 || uvz.x() > 35.0 ||
          std::abs(uvz.y()) > 3.0) {
        continue;
      }
      EXPECT_GT(FacadeCorrelation(world, &renderer, street, index1,
                                  grid.streets[street.twin], index2),
                0.7);
      ++num_tested;
    }
  }
  EXPECT_EQ(num_tested, 3);
}

TEST(WorldRenderer, BlackoutsShowNothing) {
  SyntheticWorldOptions options = SmallOptions();
  options.num_blackouts = 1;
  options.blackout_num_images = 3;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  WorldRenderer renderer(world);
  int num_dark = 0;
  for (size_t i = 0; i < world.images.size(); ++i) {
    cv::Scalar mean, deviation;
    cv::meanStdDev(renderer.Render(i), mean, deviation);
    const bool is_dark = world.images[i].keypoints.empty();
    num_dark += is_dark;
    EXPECT_EQ(deviation[0] < 3.0, is_dark);
  }
  EXPECT_EQ(num_dark, 3);
}

TEST(WorldRenderer, IsDeterministicInAnyOrder) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallOptions());
  WorldRenderer forward(world);
  WorldRenderer backward(world);
  const cv::Mat a3 = forward.Render(3);
  const cv::Mat a7 = forward.Render(7);
  const cv::Mat b7 = backward.Render(7);
  const cv::Mat b3 = backward.Render(3);
  EXPECT_EQ(cv::norm(a3, b3), 0.0);
  EXPECT_EQ(cv::norm(a7, b7), 0.0);
  EXPECT_GT(cv::norm(a3, a7), 0.0);
  EXPECT_THROW(forward.Render(12), std::out_of_range);
}

TEST(MipTexture, AveragesOverTheFootprint) {
  cv::Mat checkers(64, 64, CV_8UC3);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const uint8_t value = (x + y) % 2 == 0 ? 200 : 0;
      checkers.at<cv::Vec3b>(y, x) = cv::Vec3b(value, value, value);
    }
  }
  const MipTexture texture(checkers, 10.0);
  // At the centre of pixel (20, 30), 0.1 m wide, the texture is exact.
  const Eigen::Vector3f exact = texture.Sample(Eigen::Vector2d(2.05, 3.05), 0.1,
                                               Eigen::Vector2d(0.01, 0.0));
  EXPECT_NEAR(exact.x(), 200.0, 1e-3);
  const Eigen::Vector3f wide = texture.Sample(Eigen::Vector2d(3.21, 3.17), 0.8,
                                              Eigen::Vector2d(0.4, 0.0));
  EXPECT_NEAR(wide.x(), 100.0, 2.0);
}

}  // namespace
}  // namespace adasfm
