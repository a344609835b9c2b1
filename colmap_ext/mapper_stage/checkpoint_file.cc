// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/checkpoint_file.h"

#include <fstream>

#include "colmap_ext/io/digest.h"
#include "colmap_ext/io/output_files.h"

namespace adasfm {

Status WriteCheckpointFile(const std::string& path,
                           const std::string& fingerprint,
                           nlohmann::json content) {
  content["fingerprint"] = fingerprint;
  content["digest"] = DigestText(content.dump());
  return WriteTextFile(path, content.dump(1) + "\n");
}

CheckpointFile ReadCheckpointFile(const std::string& path,
                                  const std::string& fingerprint) {
  CheckpointFile result;
  std::ifstream file(path);
  if (!file) {
    result.problem = "there is no " + path;
    return result;
  }
  result.condition = CheckpointCondition::kDamaged;
  result.problem = path + " is damaged";
  try {
    nlohmann::json content = nlohmann::json::parse(file);
    const std::string digest = content.at("digest").get<std::string>();
    content.erase("digest");
    if (DigestText(content.dump()) != digest) return result;
    if (content.at("fingerprint").get<std::string>() != fingerprint) {
      result.condition = CheckpointCondition::kOutdated;
      result.problem =
          path + " was made with other options or another database";
      return result;
    }
    result.content = std::move(content);
  } catch (const nlohmann::json::exception&) {
    return result;
  }
  result.condition = CheckpointCondition::kSound;
  result.problem.clear();
  return result;
}

}  // namespace adasfm
