// SPDX-License-Identifier: BSD-3-Clause
#include <iostream>
#include <string>

#include "colmap_ext/commands/pair_options.h"
#include "colmap_ext/commands/progress_display.h"
#include "colmap_ext/commands/registry.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/pairs/select_pairs.h"
#include "core/check_options.h"

namespace adasfm {

Status RunAdasfmPairGenerator(int argc, char** argv) {
  PairSelectionOptions options;
  std::string database_path;
  std::string output_path;
  CommandOptions command("adasfm_pair_generator",
                         "Selects the image pairs to match (neighbours in "
                         "time, pairs with predicted overlap, similar images) "
                         "for matches_importer --match_type pairs.");
  command.AddRequired("database_path", &database_path,
                      "COLMAP database with extracted features");
  command.AddRequired(
      "output_path", &output_path,
      "text file for the pairs, one line `name1 name2` per pair");
  command.AddDefault(
      "image_times_path", &options.image_times_path,
      "image times: EuRoC data.csv, 4Seasons times.txt or TUM rgb.txt; when "
      "empty, the times that adasfm_prior_importer stored in the database, "
      "else the order of the image names");
  AddPairOptions(&options, &command);
  command.AddDefault("num_threads", &options.num_threads,
                     "number of threads; -1: all of the machine");
  const Status parsed = command.Parse(argc, argv);
  if (!parsed.ok() || command.HelpShown()) return parsed;
  const Status valid = CheckOptions(options);
  if (!valid.ok()) return valid;
  // Names that no list allows are reported before the search.
  Status names = CheckOutputIsNoInput(
      output_path, {{"database_path", database_path},
                    {"image_times_path", options.image_times_path},
                    {"descriptors_path", options.descriptors_path}});
  if (names.ok()) names = CheckOutputFile(output_path);
  if (names.ok()) names = CheckDatabase(database_path);
  if (names.ok()) names = FormatPairList({}, database_path).status();
  if (!names.ok()) return names;

  ProgressDisplay display;
  const StatusOr<PairSelection> selection =
      SelectPairs(options, database_path, display.Callback());
  display.Finish();
  if (!selection.ok()) return selection.status();
  const StatusOr<std::string> text =
      FormatPairList(selection->pairs, database_path);
  if (!text.ok()) return text.status();
  const Status written = WriteTextFile(output_path, *text);
  if (!written.ok()) return written;
  for (const std::string& warning : selection->warnings) {
    std::cout << "WARNING: " << warning << std::endl;
  }
  std::cout << selection->num_images << " images, in the order of their "
            << (selection->ordered_by_time ? "times" : "names") << ": "
            << selection->num_temporal << " pairs of neighbours, "
            << selection->num_predicted << " by the odometry, "
            << selection->num_similar << " more of similar images\n"
            << "Pairs written to " << output_path << std::endl;
  return Status::Ok();
}

}  // namespace adasfm
