// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/run_manifest.h"

#include <gtest/gtest.h>

#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

using State = RunManifest::State;

RunManifest ReadOrDie(const std::string& path) {
  StatusOr<RunManifest> manifest = RunManifest::Read(path);
  EXPECT_TRUE(manifest.ok()) << manifest.status().message();
  return std::move(manifest).value();
}

TEST(RunManifest, RemembersAcrossRuns) {
  const TemporaryFolder folder;
  const std::string path = folder.File("steps.json");
  const StepInputs inputs = {{"a", "1"}, {"b", "x"}};
  {
    RunManifest manifest = ReadOrDie(path);
    EXPECT_EQ(manifest.GetState("first", inputs), State::kNew);
    ASSERT_TRUE(manifest.Begin("first", inputs).ok());
  }
  {
    RunManifest manifest = ReadOrDie(path);
    EXPECT_EQ(manifest.GetState("first", inputs), State::kBegun);
    ASSERT_TRUE(manifest.Finish("first", 2.0).ok());
  }
  const RunManifest manifest = ReadOrDie(path);
  EXPECT_EQ(manifest.GetState("first", inputs), State::kDone);
  EXPECT_EQ(manifest.GetState("first", {{"a", "2"}, {"b", "x"}}),
            State::kChanged);
  EXPECT_EQ(manifest.DescribeChange("first", {{"a", "2"}, {"b", "x"}}),
            "a is '2', was '1'");
  EXPECT_EQ(manifest.Steps()[0].seconds, 2.0);
}

TEST(RunManifest, BeginningForgetsWhatFollows) {
  const TemporaryFolder folder;
  RunManifest manifest = ReadOrDie(folder.File("steps.json"));
  for (const char* name : {"1", "2", "3"}) {
    ASSERT_TRUE(manifest.Begin(name, {}).ok());
    ASSERT_TRUE(manifest.Finish(name, 1.0).ok());
  }
  ASSERT_TRUE(manifest.Begin("2", {{"changed", "yes"}}).ok());
  EXPECT_EQ(manifest.GetState("1", {}), State::kDone);
  EXPECT_EQ(manifest.GetState("2", {{"changed", "yes"}}), State::kBegun);
  EXPECT_EQ(manifest.GetState("3", {}), State::kNew);
}

TEST(RunManifest, DoneIsBelievedOnlyWithItsResult) {
  const TemporaryFolder folder;
  RunManifest manifest = ReadOrDie(folder.File("steps.json"));
  int num_resets = 0, num_works = 0;
  bool is_there = true, works = true;
  std::string messages;
  const auto run = [&] {
    return manifest.Run("step", {},
                        {[&] {
                           ++num_resets;
                           return Status::Ok();
                         },
                         [&] {
                           ++num_works;
                           is_there = works;
                           return Status::Ok();
                         },
                         [&] {
                           return is_there ? Status::Ok()
                                           : Status::Error("a file is missing");
                         }},
                        [&](const std::string& text) { messages += text; });
  };
  // Work that leaves no result does not count as done, however often it runs.
  works = false;
  for (int i = 0; i < 2; ++i) {
    const StatusOr<double> result = run();
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.status().message(), "a file is missing");
  }
  works = true;
  ASSERT_TRUE(run().ok());
  EXPECT_EQ(num_works, 3);
  ASSERT_TRUE(run().ok());
  EXPECT_EQ(num_works, 3);
  // A missing result is made again without a reset, and later steps are new.
  is_there = false;
  ASSERT_TRUE(manifest.Begin("later", {}).ok());
  ASSERT_TRUE(run().ok());
  EXPECT_EQ(num_works, 4);
  EXPECT_EQ(num_resets, 1);
  EXPECT_EQ(manifest.GetState("later", {}), State::kNew);
  EXPECT_NE(messages.find("done before, but a file is missing"),
            std::string::npos);
}

TEST(RunManifest, DamagedFileIsAnError) {
  const TemporaryFolder folder;
  for (const char* text :
       {"", "{", "null", "{}", "[1]", "[{\"name\": \"x\"}]"}) {
    const StatusOr<RunManifest> manifest =
        RunManifest::Read(folder.Write("steps.json", text));
    ASSERT_FALSE(manifest.ok()) << text;
    EXPECT_NE(manifest.status().message().find("steps.json"),
              std::string::npos);
  }
}

}  // namespace
}  // namespace adasfm
