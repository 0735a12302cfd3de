// Reads a mesh as gz-common's AssimpLoader does (Garden and later): with its flags, the nodes' own
// transforms and no turn of the axes. Usage: assimp_mesh FILE. Writes each corner of each triangle
// as 8 float32: position, normal, texture coordinates (v down).
#include <cstdio>
#include <iostream>

#include <assimp/Importer.hpp>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

void Write(const aiScene *scene, const aiNode *node, const aiMatrix4x4 &parent) {
  const aiMatrix4x4 place = parent * node->mTransformation;
  const aiMatrix3x3 turn(place);
  for (unsigned m = 0; m < node->mNumMeshes; ++m) {
    const auto *mesh = scene->mMeshes[node->mMeshes[m]];
    for (unsigned f = 0; f < mesh->mNumFaces; ++f)
      for (unsigned c = 0; c < 3; ++c) {
        const unsigned i = mesh->mFaces[f].mIndices[c];
        const auto at = place * mesh->mVertices[i];
        const auto up = turn * mesh->mNormals[i];
        const auto uv = mesh->HasTextureCoords(0) ? mesh->mTextureCoords[0][i] : aiVector3D();
        const float corner[] = {at.x, at.y, at.z, up.x, up.y, up.z, uv.x, uv.y};
        std::fwrite(corner, sizeof(float), 8, stdout);
      }
  }
  for (unsigned n = 0; n < node->mNumChildren; ++n) Write(scene, node->mChildren[n], place);
}

int main(int argc, char **argv) {
  Assimp::Importer importer;
  const auto *scene = importer.ReadFile(
      argc == 2 ? argv[1] : "", aiProcess_JoinIdenticalVertices | aiProcess_RemoveRedundantMaterials |
                                    aiProcess_SortByPType | aiProcess_FlipUVs |
                                    aiProcess_PopulateArmatureData | aiProcess_Triangulate |
                                    aiProcess_GenNormals);
  if (!scene) {
    std::cerr << importer.GetErrorString() << "\n";
    return 1;
  }
  Write(scene, scene->mRootNode, aiMatrix4x4());
}
