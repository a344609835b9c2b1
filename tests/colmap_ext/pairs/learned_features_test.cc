// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iomanip>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>

#include "core/sqlite.h"
#include "synthetic/synthetic_world.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"
#include "tests/testing/colmap_ext/landmark_descriptors.h"

namespace adasfm {
namespace {

// Features and matches of learned models come in through COLMAP's own
// importers (docs/guide/pair_selection.md).
class LearnedFeaturesTest : public CommandLineTest {
 protected:
  LearnedFeaturesTest() {
    SyntheticWorldOptions options;
    options.num_images = 20;
    options.num_keypoints_per_image = 100;
    world_ = BuildSyntheticWorld(options);
  }

  // An empty photo and a text file of features for every image.
  void WriteFeatures() {
    const std::string photos = folder_.File("photos");
    const std::string features = folder_.File("features");
    std::filesystem::create_directories(photos);
    std::filesystem::create_directories(features);
    LandmarkDescriptors descriptors(world_, 1);
    for (const SyntheticImage& image : world_.images) {
      cv::imwrite(
          photos + "/" + image.name,
          cv::Mat::zeros(world_.camera.height, world_.camera.width, CV_8U));
      std::ofstream file(features + "/" + image.name + ".txt");
      file << std::setprecision(9) << image.keypoints.size() << " "
           << kNumDimensions << "\n";
      for (size_t i = 0; i < image.keypoints.size(); ++i) {
        file << image.keypoints[i].x() << " " << image.keypoints[i].y()
             << " 1 0";
        for (const int byte : descriptors.Draw(image.landmark_ids[i])) {
          file << " " << byte;
        }
        file << "\n";
      }
    }
    std::ostringstream camera;
    camera << world_.camera.focal_px << "," << world_.camera.focal_px << ","
           << world_.camera.principal_x_px << ","
           << world_.camera.principal_y_px;
    ExpectSuccess("feature_importer --database_path " + imported_ +
                  " --image_path " + photos + " --import_path " + features +
                  " --ImageReader.single_camera 1 --ImageReader.camera_model "
                  "PINHOLE --ImageReader.camera_params " +
                  camera.str());
  }

  int Count(const std::string& table) {
    SqliteConnection database(imported_, SqliteConnection::Mode::kRead);
    SqliteStatement statement(
        &database, "SELECT COUNT(*) FROM " + table + " WHERE rows >= 15");
    return statement.Step() ? statement.Int(0) : 0;
  }

  void ExpectModel() {
    ExpectSuccess("adasfm_global --database_path " + imported_ +
                  " --output_path " + folder_.File("coarse"));
    ExpectSuccess("adasfm_mapper --database_path " + imported_ +
                  " --input_path " + folder_.File("coarse/0") +
                  " --output_path " + folder_.File("sparse"));
    EXPECT_TRUE(std::filesystem::exists(folder_.File("sparse/0/images.bin")));
  }

  SyntheticWorld world_;
  std::string imported_ = folder_.File("imported.db");
};

TEST_F(LearnedFeaturesTest, FeaturesAndSelectedPairs) {
  WriteFeatures();
  const std::string pairs = folder_.File("pairs.txt");
  ExpectSuccess("adasfm_pair_generator --database_path " + imported_ +
                " --output_path " + pairs);
  ExpectSuccess("matches_importer --database_path " + imported_ +
                " --match_list_path " + pairs +
                " --match_type pairs --SiftMatching.use_gpu 0");
  EXPECT_GT(Count("two_view_geometries"), 40);
  ExpectModel();
}

TEST_F(LearnedFeaturesTest, FeaturesAndMatches) {
  WriteFeatures();
  std::ostringstream matches;
  for (const SyntheticPair& pair : world_.pairs) {
    matches << world_.images[pair.image_id1 - 1].name << " "
            << world_.images[pair.image_id2 - 1].name << "\n";
    for (const FeatureMatch& match : pair.raw_matches) {
      matches << match.point2D_idx1 << " " << match.point2D_idx2 << "\n";
    }
    matches << "\n";
  }
  ExpectSuccess("matches_importer --database_path " + imported_ +
                " --match_list_path " +
                folder_.Write("matches.txt", matches.str()) +
                " --match_type raw --SiftMatching.use_gpu 0");
  EXPECT_GT(Count("two_view_geometries"), 40);
  ExpectModel();
}

}  // namespace
}  // namespace adasfm
