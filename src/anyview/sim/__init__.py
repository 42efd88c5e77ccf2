"""The planar pusher: scene, contexts, camera, environments and the scripted expert."""
